"""`springs` on an OpenCL device: pixels there, decisions here.

Each step of conjugate gradients downloads a few numbers: whether there is more to gain.  Levels of
at most ONE_GROUP pixels run in one work-group, all steps in one launch.  The preconditioner is
multigrid, not a cosine transform: weights differ by orders of magnitude, and with a preconditioner
that ignores them conjugate gradients do not converge.

Long because conjugate gradients, their weights and the grids below share buffers on the device.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.graph.backends.launch import DeviceArray, Launch
from tactograph.nodes import F4, I4
from tactograph.nodes.height.height_equations import rise_variance, surest, window_at
from tactograph.nodes.height.springs import (
    SINGLE_VISITS,
    SMALLEST,
    Ties,
    soft_inverse,
    stable_order,
)

ONE_GROUP, ONE_GROUP_OF_LANES = 4096, 20480
"""Levels of at most this many pixels are done by one work-group, all steps in one launch.  On a
CPU, whose lanes are filled, that is one core: it finishes before two cores would have started."""
PARTS = 1024
GAP = 32
"""Gaps before, between and after the levels are multiples of this length, as rows are."""
RESTRICT, REDO, LIFT, SMOOTH, SOLVE = range(5)
BEFORE_CYCLE = 3
"""Launches of a step before those of its cycle: turn, reach, advance."""
TAKEN, GOES_ON = 2, 3
"""Where the state of a solution holds the number of its steps, and whether it goes on."""


class Level(NamedTuple):
    """A network of the multigrid: its first number in the planes, its size, numbers per row."""

    first: int
    rows: int
    columns: int
    stride: int

    @property
    def size(self) -> int:
        return self.rows * self.stride

    @property
    def there(self) -> tuple[int, int, int]:
        """Its kernel arguments."""
        return self.first, self.rows, self.stride

    def at(self, pixel: NDArray[Any]) -> NDArray[Any]:
        """The places in the planes of its pixels, which are counted without gaps."""
        return self.first + pixel // self.columns * self.stride + pixel % self.columns


class Step(NamedTuple):
    """A step of a multigrid cycle."""

    what: int
    level: int
    twice: bool


@dataclass
class Stack:
    """Networks, each of 2 x 2 pixels of the one before, joined rigidly; the first is level `top`.

    `steps` are those of a cycle through them.  `dense` is the inverse of the last one's matrix.
    The host computes it when a cycle begins, because the device has other work first; until then
    `matrix` waits for the matrix.
    """

    top: Level
    right: DeviceArray
    down: DeviceArray
    inverse: DeviceArray
    steps: tuple[Step, ...]
    steps_there: DeviceArray
    dense: DeviceArray
    matrix: Callable[[], F4] | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of the heights that it solves for."""
        return self.top.rows, self.top.columns


class Wants(NamedTuple):
    """The target steps and rises of the springs, in mm, under one load or several (L x ...)."""

    right: DeviceArray
    down: DeviceArray
    rise: DeviceArray


class _Planes(NamedTuple):
    """The planes of a solution: numbers of all levels, from `base` on, `apart` for each load."""

    force: DeviceArray
    height: DeviceArray
    lifted: DeviceArray
    kept: DeviceArray
    direction: DeviceArray
    moved: DeviceArray
    z: DeviceArray
    base: int = 0
    apart: int = 0

    @property
    def place(self) -> tuple[int, int]:
        """Its kernel arguments."""
        return self.base, self.apart


class HeightSolver:
    """The equations that a launch has as its input `system`, and their solution.

    With `deepest` above 0 it also solves them on cells (`spring_cells`), after this many
    coarsenings by 2 x 2, or fewer if there are too few pixels.
    """

    def __init__(self, run: Launch, deepest: int = 0) -> None:
        self._run = run
        self.state = self._system("state")
        told = ("corner", "anchored", "scales", "top", "foot")
        coming = [run.begin_download(self._system(name)) for name in told]
        self.shape = rows, columns = self.state.shape
        self._levels = _levels(rows, columns)
        gaps = _gaps(self._levels)
        total = int(gaps[-1]) + GAP
        (self.ground,) = self._planes(1, total)
        self._whole = self._working(total)
        self._distance, self._parts = run.scratch((1,)), run.scratch((PARTS,))
        self._one_group = ONE_GROUP if run.lanes == 1 else ONE_GROUP_OF_LANES
        last = self._levels[-1]
        self._dense_at = run.put(last.at(np.arange(last.rows * last.columns)).astype(np.int32))
        self.pixels = self._stack(0, gaps)
        first, _, stride = self._levels[0].there
        run.kernel(
            "hold", run.in_row_lanes(rows, stride),
            self.state, self.ground, first, rows, columns, stride,
        )  # fmt: skip
        self._depth = min(deepest, len(self._levels) - 1)
        self.cells = self._stack(self._depth, gaps) if self._depth else None
        halved = self._levels[1 : 1 + self._depth]
        self._shares = [[run.scratch((c.rows, c.columns)) for _ in range(2)] for c in halved]
        self.wants = Wants(*(self._system(name) for name in ("right", "down", "rise")))
        self._variances = self._system("right_variance"), self._system("down_variance")
        corner, anchored, scales, top, foot = (arrived() for arrived in coming)
        self.window = window_at(corner, self.shape)
        self.place = *(int(number) for number in corner), rows, columns
        self.anchored = bool(anchored[0])
        _, self.rise_error, self.robust, self.pixel = (float(number) for number in scales)
        self._unit, self._rise_variance = float(surest(scales)), float(rise_variance(scales))
        stiffness = np.ones(top.size, np.float32)
        self._tie(Ties(top.astype(np.int64), foot.astype(np.int64), stiffness), total)
        there = [level.there for level in self._levels]
        self._levels_there = run.put(np.array([*there, (0, 0, 0)], np.int32))

    def _system(self, name: str) -> DeviceArray:
        found: DeviceArray = self._run.inputs[f"system.{name}"]
        return found

    def _stack(self, top: int, gaps: I4) -> Stack:
        """Allocate the networks from a level on; the gaps between them are cleared."""
        run = self._run
        right, down, inverse = self._planes(3, int(gaps[-1]) + GAP)
        whole = self._whole
        run.kernel(
            "clear_gaps", (gaps.size * GAP,), run.put(gaps), gaps.size, right, down, self.ground,
            whole.height, whole.lifted, whole.z,
        )  # fmt: skip
        steps = _cycle_of(len(self._levels), top)
        steps_there = run.put(np.array(steps, np.int32))
        (size,) = self._dense_at.shape
        # Its rows are padded to whole lanes.
        dense = run.scratch((size, -(-size // GAP) * GAP))
        return Stack(self._levels[top], right, down, inverse, steps, steps_there, dense)

    def _working(self, size: int, base: int = 0, apart: int = 0) -> _Planes:
        force, height, lifted, kept, direction, moved, z = self._planes(7, size)
        return _Planes(force, height, lifted, kept, direction, moved, z, base, apart)

    def _planes(self, count: int, size: int) -> list[DeviceArray]:
        return [self._run.scratch((size,)) for _ in range(count)]

    def _tie(self, ties: Ties, total: int) -> None:
        """The rises as ties of every level, and where in the planes they are."""
        run = self._run
        found = _tie_levels(ties, self._levels)
        self._ties, self._all_ties = ties.top.size, len(found.member_start) - 1
        self._finest_ends = run.put(np.stack(ties[:2], axis=1).astype(np.int32))
        self._finest = run.scratch((self._ties,))
        self._stiffness = run.scratch((self._all_ties,))
        self._members = run.put(found.member_start), run.put(found.members)
        runs = total // run.lanes
        starts = np.append(0, np.cumsum(np.bincount(found.knot_own // run.lanes, minlength=runs)))
        marks = run.scratch((runs,), np.uint8)
        self._knot_tie, stiffness = run.put(found.knot_tie), run.scratch(found.knot_tie.shape)
        own, other = run.put(found.knot_own), run.put(found.knot_other)
        self._knots = marks, run.put(starts.astype(np.int32)), own, other, stiffness

    @property
    def rises(self) -> int:
        """How many rises have both ends in the window."""
        return self._ties

    def _network(self, stack: Stack) -> tuple[DeviceArray, ...]:
        planes = stack.right, stack.down, self.ground, stack.inverse
        return *planes, *self._knots

    def cut(self, height: DeviceArray) -> DeviceArray:
        """A height over the frame, inside the window, and zero on the film at rest."""
        run, found = self._run, self._run.scratch(self.shape)
        first, _, stride = self._levels[0].there
        run.kernel(
            "cut", run.in_row_lanes(*self.shape),
            height, self.ground, found, first, stride, run.sizes["W"], *self.place,
        )  # fmt: skip
        return found

    def cost(self, height: DeviceArray, scale: float) -> float:
        """The value of `HeightSystem.cost`."""
        run, parts = self._run, self._parts
        run.kernel(
            "cost_parts", (PARTS,), height, *self.wants, *self._variances, self._finest_ends, parts,
            *self.shape, self._ties, self._rise_variance, float(np.float32(scale * scale)),
        )  # fmt: skip
        return float(run.download(parts).sum(dtype=float))

    def weigh(self, height: DeviceArray, scale: float) -> None:
        """Make the networks of all levels, each spring weaker the farther `height` is from it."""
        run, square, unit = self._run, float(np.float32(scale * scale)), self._unit
        if self._ties:
            run.kernel(
                "stiffen_rises", (self._ties,), height, self.wants.rise, self._finest_ends,
                self._finest, self._ties, self._rise_variance, unit, square,
            )  # fmt: skip
            run.kernel(
                "join_ties", (self._all_ties,),
                self._finest, *self._members, self._stiffness, self._all_ties,
            )  # fmt: skip
            entries = self._knots[-1]
            run.kernel(
                "stiffen_knots", entries.shape, self._stiffness, self._knot_tie, entries,
                *entries.shape,
            )  # fmt: skip
        first, rows, stride = self._levels[0].there
        run.kernel(
            "stiffen", run.in_row_lanes(rows, stride), height, *self.wants[:2], *self._variances,
            self.pixels.right, self.pixels.down, first, rows, self.shape[1], stride, unit, square,
        )  # fmt: skip
        self._join(self.pixels)
        if self.cells is not None:
            for (fine, cell, stack), shares in zip(self._halvings(), self._shares, strict=True):
                run.kernel(
                    "springs_of_cells", (cell.rows, cell.stride), stack.right, stack.down,
                    self.cells.right, self.cells.down, *shares, *fine, *cell,
                )  # fmt: skip
            self._join(self.cells)

    def _halvings(self) -> Iterator[tuple[Level, Level, Stack]]:
        """Pixels and their cells down to the coarsest, and where the pixels' springs are."""
        assert self.cells is not None
        for fine, cell in zip(self._levels[: self._depth], self._levels[1:], strict=False):
            yield fine, cell, self.cells if fine.first != self._levels[0].first else self.pixels

    def _join(self, stack: Stack) -> None:
        """Make the networks below the first."""
        run, levels, network = self._run, self._levels, self._network(stack)
        *planes, marks, starts, own, _, stiffness = network
        number = levels.index(stack.top)
        joined = *planes, marks, starts, own, stiffness
        while levels[number].size > self._one_group:
            fine, coarse = levels[number], levels[number + 1]
            run.kernel("invert_diagonal", run.in_lanes(fine.size), *joined, *fine.there)
            run.kernel(
                "coarsen_level", run.in_lanes(coarse.size),
                stack.right, stack.down, self.ground, *fine.there, *coarse.there,
            )  # fmt: skip
            number += 1
        run.kernel(
            "join_small_levels", (run.group,), *joined, self._levels_there, number,
            len(levels) - 1, local=(run.group,),
        )  # fmt: skip
        last = levels[-1]
        size = last.rows * last.columns
        matrix = run.scratch((size, size))
        run.kernel(
            "dense_matrix", (size, size), *network, self._dense_at, matrix, size, last.stride
        )
        stack.matrix = run.begin_download(matrix)

    def _invert(self, stack: Stack) -> None:
        """Find the inverse of the coarsest level's matrix, if it has changed."""
        if stack.matrix is not None:
            inverse = soft_inverse(stack.matrix())
            self._run.send(np.pad(inverse, ((0, 0), (0, -len(inverse) % GAP))), stack.dense)
            stack.matrix = None

    def room(self, stack: Stack, loads: int) -> Wants:
        """Allocate the springs' targets under `loads` loads."""
        run, ties = self._run, self._ties if stack is self.pixels else self._all_ties
        right, down = (run.scratch((loads, *stack.shape)) for _ in range(2))
        return Wants(right, down, run.scratch((loads, ties)))

    def wants_of_cells(self, wants: Wants, number: int, out: Wants, to: int) -> None:
        """Find the targets of the cells' springs under load `to` from those between pixels."""
        run = self._run
        if self._all_ties:
            run.kernel(
                "join_rises", (self._all_ties,), self._finest, wants.rise, *self._members,
                out.rise, self._all_ties, number, self._ties, to,
            )  # fmt: skip
        right, down = wants.right, wants.down
        shape: tuple[int, ...] = self.shape
        for shares in self._shares:
            smaller, last = shares[0].shape, shares is self._shares[-1]
            east, south = (out.right, out.down) if last else self._planes(2, math.prod(smaller))
            run.kernel(
                "wants_of_cells", run.in_row_lanes(*smaller), right, down, *shares, east, south,
                *shape, *smaller, number, to if last else 0,
            )  # fmt: skip
            right, down, shape, number = east, south, smaller, 0

    def on_pixels(self, planes: DeviceArray, number: int, out: DeviceArray) -> None:
        """Interpolate the cells' values under a load at the pixels."""
        run, source, size = self._run, planes, planes.shape[-2:]
        for level in reversed(self._levels[: self._depth]):
            shape = level.rows, level.columns
            to = out if level is self._levels[0] else run.scratch(shape)
            run.kernel(
                "on_pixels", run.in_row_lanes(*shape[:1], size[1]), source, to, *size, *shape,
                number,
            )  # fmt: skip
            source, size, number = to, shape, 0

    def solve(
        self,
        stack: Stack,
        wants: Wants,
        height: DeviceArray,
        steps: int,
        enough: DeviceArray,
        number: int = 0,
        to: int = 0,
    ) -> Callable[[], bool]:
        """Improve height `to` under load `number` in place, as `conjugate_gradients` does.

        Return a function that waits and tells whether it moved.
        """
        run, planes, (rows, columns) = self._run, self._whole, stack.shape
        first, _, stride = stack.top.there
        by_rows = run.in_row_lanes(rows, stride)
        run.kernel("take_height", by_rows, height, planes.z, first, rows, columns, stride, to)
        self._unbalance(stack, wants, planes, number, 1)
        if self._is_small(stack.steps[0]):
            moved = self._small_gradients(stack, planes, steps, enough, number, 1)
        else:
            moved = self._gradients(stack, steps, enough, number)
        self._give_heights(stack, planes, height, to, 1)
        return lambda: bool(moved()[0, TAKEN] > 0)

    def solve_all(
        self, stack: Stack, wants: Wants, heights: DeviceArray, steps: int, enough: DeviceArray
    ) -> None:
        """Find the heights under all loads, from zero: side by side if there are few pixels."""
        run, (loads,) = self._run, enough.shape
        if not self._is_small(stack.steps[0]):
            run.kernel(
                "clear", run.in_lanes(math.prod(heights.shape)), heights, math.prod(heights.shape)
            )
            for number in range(loads):
                self.solve(stack, wants, heights, steps, enough, number, number)
            return
        last = self._levels[-1]
        base = stack.top.first - stack.top.stride
        apart = last.first + last.size + last.stride + 2 * GAP - base
        planes = self._working(loads * apart, base, apart)
        # The gaps between levels must be finite, and the start is zero.
        for plane in (planes.height, planes.lifted, planes.z):
            run.kernel("clear", run.in_lanes(loads * apart), plane, loads * apart)
        self._unbalance(stack, wants, planes, 0, loads)
        self._small_gradients(stack, planes, steps, enough, 0, loads)
        self._give_heights(stack, planes, heights, 0, loads)

    def _unbalance(
        self, stack: Stack, wants: Wants, planes: _Planes, number: int, loads: int
    ) -> None:
        """The residual forces of the loads from `number` on at the heights z."""
        run, (rows, columns), (first, _, stride) = self._run, stack.shape, stack.top.there
        run.kernel(
            "imbalance", run.in_row_lanes(loads * rows, stride), *self._network(stack),
            self._knot_tie, *wants, planes.z, planes.force, planes.lifted,
            first, rows, columns, stride, number, loads, wants.rise.shape[-1], *planes.place,
        )  # fmt: skip

    def _give_heights(
        self, stack: Stack, planes: _Planes, heights: DeviceArray, to: int, loads: int
    ) -> None:
        run, (rows, columns), (first, _, stride) = self._run, stack.shape, stack.top.there
        run.kernel(
            "give_heights", run.in_row_lanes(loads * rows, columns), planes.z, heights,
            first, rows, columns, stride, to, loads, *planes.place,
        )  # fmt: skip

    def _small_gradients(
        self,
        stack: Stack,
        planes: _Planes,
        steps: int,
        enough: DeviceArray,
        number: int,
        loads: int,
    ) -> Callable[[], NDArray[Any]]:
        """Take the steps if the first level is small, too: one launch each, without waiting.

        Each load has a work-group.  Returns a function that waits for the solutions' state.
        """
        run, gain = self._run, self._beginning(loads)
        step = run.capture(
            lambda: run.kernel(
                "small_step", (loads * run.group,), *self._cycle_there(stack, planes), 0,
                len(stack.steps), planes.direction, planes.moved, planes.z, gain, enough, number,
                *stack.top.there, *planes.place, local=(run.group,),
            )
        )  # fmt: skip
        self._invert(stack)
        for _ in range(steps + 1):
            step()
        return run.begin_download(gain)

    def _gradients(
        self, stack: Stack, steps: int, enough: DeviceArray, number: int
    ) -> Callable[[], NDArray[Any]]:
        """Take the steps if the first level is large.

        Whether a step was the last is read when the next is enqueued, so that the device never
        waits for the host.  Once a solution has ended, its kernels return at once.
        """
        run, gain = self._run, self._beginning(1)
        step = run.capture(lambda: self._step(stack, gain, enough, number))
        # On large levels the way down does not need the coarsest inverse, so it goes first.
        down = self._launches_down(stack)
        step(to=down)
        self._invert(stack)
        step(since=down)
        stands = run.begin_download(gain)
        for _ in range(steps):
            before = stands
            step()
            stands = run.begin_download(gain)
            if not before()[0, GOES_ON]:
                break
        return stands

    def _launches_down(self, stack: Stack) -> int:
        """How many launches of a step come before those on small levels."""
        large = next(n for n, step in enumerate(stack.steps) if self._is_small(step))
        return BEFORE_CYCLE + large

    def _beginning(self, loads: int) -> DeviceArray:
        """The state of solutions before their first cycle; springs.clh explains the numbers."""
        return self._run.put(np.tile(np.array([0, 0, -1, 1], np.float32), (loads, 1)))

    def _step(self, stack: Stack, gain: DeviceArray, enough: DeviceArray, number: int) -> None:
        """A step and the cycle after it; or, as a solution begins, the cycle alone."""
        run, there, network, planes = self._run, stack.top.there, self._network(stack), self._whole
        run.kernel(
            "turn", (PARTS,), *network, planes.height, planes.direction, planes.moved, self._parts,
            *there, gain,
        )  # fmt: skip
        run.kernel("reach", (1,), self._parts, self._distance, gain)
        run.kernel(
            "advance", run.in_lanes(stack.top.size), planes.direction, planes.moved, stack.inverse,
            planes.z, planes.force, planes.lifted, self._distance, *there, gain,
        )  # fmt: skip
        self._cycle(stack, gain)
        run.kernel("end_step", (1,), self._parts, gain, enough, number)

    def energies(self, stack: Stack, wants: Wants, loads: int = 1) -> DeviceArray:
        """The value of `Springs.energy` for the first loads."""
        run, (first, rows, stride) = self._run, stack.top.there
        parts, found = run.scratch((loads, PARTS)), run.scratch((loads,))
        run.kernel(
            "energy_parts", (loads * PARTS,), stack.right, stack.down, wants.right, wants.down,
            parts, first, rows, stack.top.columns, stride, loads,
        )  # fmt: skip
        run.kernel("add_energies", (loads,), parts, found, loads)
        return found

    def enough(
        self,
        share: float,
        energies: DeviceArray,
        others: DeviceArray | None = None,
        part: float = 0.0,
    ) -> DeviceArray:
        """A share of each energy, or of `part` of the first of `others` if that is more."""
        run, (loads,) = self._run, energies.shape
        found = run.scratch((loads,))
        run.kernel("be_enough", (loads,), energies, others, found, loads, share, part)
        return found

    def _cycle(self, stack: Stack, gain: DeviceArray) -> None:
        """One multigrid cycle: from the force on the first level, a large one, to its height."""
        run, (*steps, _) = self._run, stack.steps
        at = 0
        while at < len(steps):
            end = at + 1
            if not self._is_small(steps[at]):
                self._large_step(stack, steps[at], gain)
            else:
                while end < len(steps) and self._is_small(steps[end]):
                    end += 1
                self._small_steps(stack, at, end, gain)
            at = end
        run.kernel(
            "smooth_and_sum", (PARTS,), *self._network(stack), *self._whole[:3], self._parts,
            *stack.top.there, gain,
        )  # fmt: skip

    def _is_small(self, step: Step) -> bool:
        return self._levels[step.level].size <= self._one_group

    def _cycle_there(self, stack: Stack, planes: _Planes) -> tuple[Any, ...]:
        """Arguments of the kernels for small levels."""
        (count,), dense = self._dense_at.shape, stack.dense
        return (
            *self._network(stack), *planes[:4],
            dense, self._dense_at, count, dense.shape[1], self._levels_there, stack.steps_there,
        )  # fmt: skip

    def _small_steps(self, stack: Stack, first: int, end: int, gain: DeviceArray) -> None:
        run = self._run
        there = self._cycle_there(stack, self._whole)
        run.kernel("small_levels", (run.group,), *there, first, end, gain, local=(run.group,))

    def _large_step(self, stack: Stack, step: Step, gain: DeviceArray) -> None:
        run, level, network = self._run, self._levels[step.level], self._network(stack)
        coarse, (force, height, lifted, kept, *_) = self._levels[step.level + 1], self._whole
        here, blocks = run.in_lanes(level.size), run.in_lanes(coarse.size)
        if step.what == RESTRICT:
            run.kernel(
                "restrict_level", blocks,
                *network, force, lifted, *level.there, *coarse.there, gain,
            )  # fmt: skip
        elif step.what == REDO:
            run.kernel(
                "redo_level", here,
                *network, force, height, lifted, kept, *level.there, gain,
            )  # fmt: skip
        elif step.what == LIFT:
            run.kernel(
                "lift_level", blocks, height, lifted, kept, int(step.twice),
                *level.there, *coarse.there, gain,
            )  # fmt: skip
        else:
            run.kernel(
                "smooth_level", here,
                *network, force, height, lifted, *level.there, gain,
            )  # fmt: skip


def _levels(rows: int, columns: int) -> list[Level]:
    levels = [Level(_row(columns), rows, columns, _row(columns))]
    while levels[-1].rows * levels[-1].columns > SMALLEST:
        first, rows, columns, stride = levels[-1]
        behind = first + (rows + 1) * stride
        rows, columns = (rows + 1) // 2, (columns + 1) // 2
        levels.append(Level(behind, rows, columns, _row(columns)))
    return levels


def _row(columns: int) -> int:
    """The numbers that a row takes: whole lanes, and twice as many on the level before."""
    return -(-columns // GAP) * GAP


def _gaps(levels: Sequence[Level]) -> I4:
    """Where the runs of numbers begin that belong to no level, and the row after the last.

    The coarsest level is among them: only its pixels get heights, not the padding of its rows.
    """
    *finer, last = levels
    begins = [0, *(level.first + level.size for level in finer)]
    # Lanes at the end of a level read one run beyond the row after it.
    ends = [*(level.first for level in finer), last.first + last.size + last.stride + GAP]
    runs = [np.arange(begin, end, GAP) for begin, end in zip(begins, ends, strict=True)]
    return np.concatenate(runs).astype(np.int32)


@lru_cache(maxsize=16)
def _cycle_of(levels: int, top: int) -> tuple[Step, ...]:
    """The steps of `springs.cycle`, from level `top` on."""
    return tuple(_steps(levels, top))


def _steps(levels: int, at: int, depth: int = 0) -> Iterator[Step]:
    if at == levels - 1:
        yield Step(SOLVE, at, twice=False)
        return
    yield Step(RESTRICT, at, twice=False)
    yield from _steps(levels, at + 1, depth + 1)
    twice = depth + 1 >= SINGLE_VISITS and at + 2 < levels
    if twice:
        yield Step(REDO, at + 1, twice=False)
        yield from _steps(levels, at + 1, depth + 1)
    yield Step(LIFT, at, twice)
    yield Step(SMOOTH, at, twice=False)


class _TieLevels(NamedTuple):
    """The ties of all levels, one after another.

    Tie t joins the finest ties `members[member_start[t]:...]`.  Pixel `knot_own[n]` is an end of
    the tie `knot_tie[n]`, with ~t where it is the foot of t; the other end is `knot_other[n]`.
    """

    member_start: I4
    members: I4
    knot_own: I4
    knot_tie: I4
    knot_other: I4


def _tie_levels(ties: Ties, levels: Sequence[Level]) -> _TieLevels:
    """The finest ties unchanged; on each coarser level, ties of the same two blocks are merged."""
    count, width = ties.top.size, levels[0].columns
    depth = np.arange(len(levels))[:, None]
    first, stride = (np.array([level[n] for level in levels])[:, None] for n in (0, 3))
    at = [
        first + (end // width >> depth) * stride + (end % width >> depth)
        for end in (ties.top, ties.foot)
    ]
    # A tie whose ends lie in one block joins none.
    level, finest = np.nonzero(at[0][1:] != at[1][1:])
    top, foot = (end[level + 1, finest] for end in at)
    pairs = top * (levels[-1].first + levels[-1].size) + foot
    order = stable_order(pairs)
    begins = np.flatnonzero(np.diff(pairs[order], prepend=-1))
    own = [np.concatenate([at[n][0], end[order[begins]]]) for n, end in enumerate((top, foot))]
    numbers = np.arange(own[0].size)
    member_start = np.concatenate([numbers[:count], count + begins, [count + order.size]])
    members = np.concatenate([numbers[:count], finest[order]])
    order = stable_order(np.concatenate(own))
    knot_own, knot_other = (np.concatenate(ends)[order] for ends in (own, own[::-1]))
    knot_tie = np.concatenate([numbers, ~numbers])[order]
    found = member_start, members, knot_own, knot_tie, knot_other
    return _TieLevels(*(array.astype(np.int32) for array in found))
