"""The networks of `springs` on an OpenCL device: pixels, cells, and their coarser levels.

`height_solver` finds the heights that balance them.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tactograph.graph.backends.launch import DeviceArray, Launch
from tactograph.nodes import I4
from tactograph.nodes.height.height_equations import (
    SHARED_RISE_PX,
    rise_variance,
    surest,
    window_at,
)
from tactograph.nodes.height.height_levels import (
    GAP_PIXELS,
    Level,
    Step,
    cycle_of,
    gaps_of,
    levels_of,
    tie_levels,
)
from tactograph.nodes.height.springs import Ties

ONE_GROUP_PIXELS = 20480
"""One work-group computes all steps of levels with at most this many pixels, in one launch.  On a
CPU that is one core, which finishes before many cores would have started.  On a GPU it saves
launches, which take the host 15 us each."""
MANY_UNITS = 8
"""Compute units for which that limit holds; on a device with fewer the limit is higher."""
SUM_PARTS = 1024
STARTS_PER_ITEM = 32
"""How many starts of knots a work-item finds."""


@dataclass
class Stack:
    """Networks of a multigrid from level `top` on; each joins 2 x 2 pixels of the finer rigidly.

    `steps` are the steps of one cycle.
    """

    top: Level
    right: DeviceArray
    down: DeviceArray
    inverse: DeviceArray
    steps: tuple[Step, ...]
    steps_there: DeviceArray

    @property
    def shape(self) -> tuple[int, int]:
        """The shape of the heights on the finest level."""
        return self.top.rows, self.top.columns


class Wants(NamedTuple):
    """The target steps and rises of the springs, in mm, for one load or several (L x ...)."""

    right: DeviceArray
    down: DeviceArray
    rise: DeviceArray


class Planes(NamedTuple):
    """The planes of a solution: values of all levels from index `base`, one load per `apart`."""

    force: DeviceArray
    height: DeviceArray
    lifted: DeviceArray
    saved: DeviceArray
    direction: DeviceArray
    moved: DeviceArray
    z: DeviceArray
    base: int = 0
    apart: int = 0

    @property
    def place(self) -> tuple[int, int]:
        """Its kernel arguments."""
        return self.base, self.apart


class HeightNetworks:
    """The equations of a launch's input `system` as networks of springs.

    There are also networks of cells of 2 x 2 pixels (`spring_cells`) if the image is large enough.
    """

    def __init__(self, run: Launch, with_cells: bool = False) -> None:
        self._run = run
        self._group_pixels = ONE_GROUP_PIXELS * max(1, MANY_UNITS // run.units)
        self.state = self._system("state")
        fields = ("corner", "anchored", "scales", "top", "foot")
        coming = [run.begin_download(self._system(name)) for name in fields]
        self.shape = rows, columns = self.state.shape
        self.levels = levels_of(rows, columns)
        gaps = gaps_of(self.levels)
        total = int(gaps[-1]) + GAP_PIXELS
        (self.ground,) = self._new_planes(1, total)
        self.planes = self.working_planes(total)
        self.parts = run.scratch((SUM_PARTS,))
        self.pixels = self._stack(0, gaps)
        first, _, stride = self.levels[0].place
        run.kernel(
            "hold", run.in_row_lanes(rows, stride),
            self.state, self.ground, first, rows, columns, stride,
        )  # fmt: skip
        self.cells = self._stack(1, gaps) if with_cells and len(self.levels) > 1 else None
        self._shares = [] if self.cells is None else [run.scratch(self.cells.shape) for _ in "pq"]
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
        sizes = [level.place for level in self.levels]
        self.levels_there = run.put(np.array([*sizes, (0, 0, 0)], np.int32))

    def _system(self, name: str) -> DeviceArray:
        array: DeviceArray = self._run.inputs[f"system.{name}"]
        return array

    def _stack(self, top: int, gaps: I4) -> Stack:
        """Allocate the networks from level `top` on, and clear the gaps between them."""
        run = self._run
        right, down, inverse = self._new_planes(3, int(gaps[-1]) + GAP_PIXELS)
        whole = self.planes
        run.kernel(
            "clear_gaps", (gaps.size * GAP_PIXELS,), run.put(gaps), gaps.size, right, down,
            self.ground, whole.height, whole.lifted, whole.z,
        )  # fmt: skip
        steps = cycle_of(len(self.levels), top)
        steps_there = run.keep(steps, lambda: run.put(np.array(steps, np.int32)))
        return Stack(self.levels[top], right, down, inverse, steps, steps_there)

    def working_planes(self, size: int, base: int = 0, apart: int = 0) -> Planes:
        force, height, lifted, residual, direction, moved, z = self._new_planes(7, size)
        return Planes(force, height, lifted, residual, direction, moved, z, base, apart)

    def _new_planes(self, count: int, size: int) -> list[DeviceArray]:
        return [self._run.scratch((size,)) for _ in range(count)]

    def _tie(self, ties: Ties, total: int) -> None:
        """Upload the rises as ties of every level, with their places in the planes."""
        run = self._run
        levels = tie_levels(ties, self.levels)
        # The rises with both ends in the window, and the ties that they make on all levels.
        self.rises, self._all_ties = ties.top.size, len(levels.member_start) - 1
        self.finest_ends = run.put(np.stack(ties[:2], axis=1).astype(np.int32))
        self._finest = run.scratch((self.rises,))
        self._members = run.put(levels.member_start), run.put(levels.members)
        runs = total // run.lanes
        marks, starts = run.scratch((runs,), np.uint8), run.scratch((runs + 1,), np.int32)
        self.knot_tie, stiffness = run.put(levels.knot_tie), run.scratch(levels.knot_tie.shape)
        own, other = run.put(levels.knot_own), run.put(levels.knot_other)
        items = -(-starts.shape[0] // STARTS_PER_ITEM)
        run.kernel("find_knots", (items,), own, starts, *starts.shape, *own.shape)
        self._knots = marks, starts, own, other, stiffness

    def is_small(self, level: Level) -> bool:
        """Return whether one work-group computes the level."""
        return level.size <= self._group_pixels

    def arguments(self, stack: Stack) -> tuple[DeviceArray, ...]:
        planes = stack.right, stack.down, self.ground, stack.inverse
        return *planes, *self._knots

    def cut(self, height: DeviceArray) -> DeviceArray:
        """The part of a height inside the window, set to zero on the film at rest."""
        run, inside = self._run, self._run.scratch(self.shape)
        first, _, stride = self.levels[0].place
        run.kernel(
            "cut", run.in_row_lanes(*self.shape),
            height, self.ground, inside, first, stride, run.sizes["W"], *self.place,
        )  # fmt: skip
        return inside

    def cost(self, height: DeviceArray, scale: float) -> float:
        """The value of `HeightSystem.cost`."""
        run, parts = self._run, self.parts
        run.kernel(
            "cost_parts", (SUM_PARTS,), height, *self.wants, *self._variances, self.finest_ends,
            parts, *self.shape, self.rises, self._rise_variance, float(np.float32(scale * scale)),
        )  # fmt: skip
        return float(run.download(parts).sum(dtype=float))

    def weigh(
        self, height: DeviceArray, scale: float, rise: DeviceArray | None = None, lifts: int = 0
    ) -> None:
        """Compute the stiffness of all levels from Cauchy's weights of `height`.

        Write the rises to `rise`, or, if it `lifts` them, reduce those there by the disagreement.
        """
        run, square, unit = self._run, float(np.float32(scale * scale)), self._unit
        if self.rises:
            run.kernel(
                "stiffen_rises", (run.group,), height, self.wants.rise, self.finest_ends,
                self._finest, rise, self.rises, self._rise_variance, unit, square,
                SHARED_RISE_PX * self.pixel, lifts, local=(run.group,),
            )  # fmt: skip
            entries = self._knots[-1]
            run.kernel(
                "stiffen_knots", entries.shape, self._finest, *self._members, self.knot_tie,
                entries, *entries.shape,
            )  # fmt: skip
        first, rows, stride = self.levels[0].place
        run.kernel(
            "stiffen", run.in_row_lanes(rows, stride), height, *self.wants[:2], *self._variances,
            self.pixels.right, self.pixels.down, first, rows, self.shape[1], stride, unit, square,
        )  # fmt: skip
        self._join(self.pixels)
        if self.cells is not None:
            fine, cell = self.levels[:2]
            run.kernel(
                "springs_of_cells", (cell.rows, cell.stride), self.pixels.right, self.pixels.down,
                self.cells.right, self.cells.down, *self._shares, *fine, *cell,
            )  # fmt: skip
            self._join(self.cells)

    def _join(self, stack: Stack) -> None:
        """Compute the coarser networks from the finest."""
        run, levels, network = self._run, self.levels, self.arguments(stack)
        *planes, marks, starts, own, _, stiffness = network
        number = levels.index(stack.top)
        joined = *planes, marks, starts, own, stiffness
        while not self.is_small(levels[number]):
            fine, coarse = levels[number], levels[number + 1]
            run.kernel("invert_diagonal", run.in_lanes(fine.size), *joined, *fine.place)
            run.kernel(
                "coarsen_level", run.in_lanes(coarse.size),
                stack.right, stack.down, self.ground, *fine.place, *coarse.place,
            )  # fmt: skip
            number += 1
        run.kernel(
            "join_small_levels", (run.group,), *joined, self.levels_there, number,
            len(levels) - 1, local=(run.group,),
        )  # fmt: skip

    def room(self, stack: Stack, loads: int) -> Wants:
        """Allocate the springs' targets for several loads."""
        run, ties = self._run, self.rises if stack is self.pixels else self._all_ties
        right, down = (run.scratch((loads, *stack.shape)) for _ in range(2))
        return Wants(right, down, run.scratch((loads, ties)))

    def wants_of_cells(self, wants: Wants, out: Wants, to: int) -> None:
        """Compute the targets of the cells' springs for load `to` from those between pixels."""
        run = self._run
        if self._all_ties:
            run.kernel(
                "join_rises", (self._all_ties,),
                self._finest, wants.rise, *self._members, out.rise, self._all_ties, to,
            )  # fmt: skip
        smaller = self._shares[0].shape
        run.kernel(
            "wants_of_cells", run.in_row_lanes(*smaller), wants.right, wants.down, *self._shares,
            out.right, out.down, *self.shape, *smaller, to,
        )  # fmt: skip

    def on_pixels(self, plane: DeviceArray, out: DeviceArray) -> None:
        """Interpolate the cells' values at the pixels."""
        run, size = self._run, plane.shape[-2:]
        grid = run.in_row_lanes(self.shape[0], size[1])
        run.kernel("on_pixels", grid, plane, out, *size, *self.shape)

    def enough(self, share: float, stack: Stack, wants: Wants, loads: int = 1) -> DeviceArray:
        """A share of `Springs.energy` for the first loads."""
        run, (first, rows, stride) = self._run, stack.top.place
        parts, limits = run.scratch((loads, SUM_PARTS)), run.scratch((loads,))
        run.kernel(
            "energy_parts", (loads * SUM_PARTS * run.group,), stack.right, stack.down,
            wants.right, wants.down, parts, first, rows, stack.top.columns, stride, local=run.part,
        )  # fmt: skip
        each = loads * run.group
        run.kernel("be_enough", (each,), parts, limits, share, local=(run.group,))
        return limits
