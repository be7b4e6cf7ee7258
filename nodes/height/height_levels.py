"""The levels of a multigrid: their places in shared planes, their ties, the order of steps.

The host lays them out; `height_networks` and `height_solver` compute with them on the device.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import I4
from tactograph.nodes.height.springs import MAX_COARSEST_PIXELS, SINGLE_VISITS, Ties

GAP_PIXELS = 32
"""The length of rows, and of gaps before, between and after the levels, is a multiple of this."""
STEP_RESTRICT, STEP_REDO, STEP_LIFT, STEP_SMOOTH = range(4)


class Level(NamedTuple):
    """A network of the multigrid: its first index in the planes, its size, and its row length."""

    first: int
    rows: int
    columns: int
    stride: int

    @property
    def size(self) -> int:
        return self.rows * self.stride

    @property
    def place(self) -> tuple[int, int, int]:
        """The kernel arguments of the level."""
        return self.first, self.rows, self.stride

    def at(self, pixel: NDArray[Any]) -> NDArray[Any]:
        """The indices in the planes of pixels that are numbered without gaps."""
        return self.first + pixel // self.columns * self.stride + pixel % self.columns


class Step(NamedTuple):
    """A step of a multigrid cycle."""

    action: int
    level: int
    twice: bool


def levels_of(rows: int, columns: int) -> list[Level]:
    levels = [Level(_row(columns), rows, columns, _row(columns))]
    while levels[-1].rows * levels[-1].columns > MAX_COARSEST_PIXELS:
        first, rows, columns, stride = levels[-1]
        behind = first + (rows + 1) * stride
        rows, columns = (rows + 1) // 2, (columns + 1) // 2
        levels.append(Level(behind, rows, columns, _row(columns)))
    return levels


def _row(columns: int) -> int:
    """The length of a row, rounded up to whole runs of lanes."""
    return -(-columns // GAP_PIXELS) * GAP_PIXELS


def gaps_of(levels: Sequence[Level]) -> I4:
    """The starts of the gaps between levels, and of the row after the last level."""
    last = levels[-1]
    begins = [0, *(level.first + level.size for level in levels)]
    # Lanes at the end of a level read one run of lanes beyond the next row.
    ends = [*(level.first for level in levels), last.first + last.size + last.stride + GAP_PIXELS]
    runs = [np.arange(begin, end, GAP_PIXELS) for begin, end in zip(begins, ends, strict=True)]
    return np.concatenate(runs).astype(np.int32)


@lru_cache(maxsize=16)
def cycle_of(levels: int, top: int) -> tuple[Step, ...]:
    """The steps of `springs.cycle`, from level `top` on."""
    return tuple(_steps(levels, top))


def _steps(levels: int, at: int, depth: int = 0) -> Iterator[Step]:
    if at + 1 < levels:
        yield Step(STEP_RESTRICT, at, twice=False)
        yield from _steps(levels, at + 1, depth + 1)
        twice = depth + 1 >= SINGLE_VISITS and at + 1 + SINGLE_VISITS < levels
        if twice:
            yield Step(STEP_REDO, at + 1, twice=False)
            yield from _steps(levels, at + 1, depth + 1)
        yield Step(STEP_LIFT, at, twice)
    yield Step(STEP_SMOOTH, at, twice=False)


class TieLevels(NamedTuple):
    """The ties of all levels, level by level.

    Tie t joins the finest ties `members[member_start[t]:...]`.  Pixel `knot_own[n]` is an end of
    the tie `knot_tie[n]`, with ~t where it is the foot of t; the other end is `knot_other[n]`.
    """

    member_start: I4
    members: I4
    knot_own: I4
    knot_tie: I4
    knot_other: I4


def tie_levels(ties: Ties, levels: Sequence[Level]) -> TieLevels:
    """The finest ties unchanged; on coarser levels, ties that join the same blocks are merged."""
    count, width = ties.top.size, levels[0].columns
    depth = np.arange(len(levels))[:, None]
    first, stride = (np.array([level[n] for level in levels])[:, None] for n in (0, 3))
    ends = ties.top, ties.foot
    at = [first + (end // width >> depth) * stride + (end % width >> depth) for end in ends]
    # A tie whose ends lie in one block vanishes.
    level, finest = np.nonzero(at[0][1:] != at[1][1:])
    top, foot = (end[level + 1, finest] for end in at)
    pairs = top * (levels[-1].first + levels[-1].size) + foot
    order = np.argsort(pairs, kind="stable")
    begins = np.flatnonzero(np.diff(pairs[order], prepend=-1))
    place = [np.concatenate([at[n][0], end[order[begins]]]) for n, end in enumerate((top, foot))]
    numbers = np.arange(place[0].size)
    member_start = np.concatenate([numbers[:count], count + begins, [count + order.size]])
    members = np.concatenate([numbers[:count], finest[order]])
    order = np.argsort(np.concatenate(place), kind="stable")
    knot_own, knot_other = (np.concatenate(ends)[order] for ends in (place, place[::-1]))
    knot_tie = np.concatenate([numbers, ~numbers])[order]
    arrays = member_start, members, knot_own, knot_tie, knot_other
    return TieLevels(*(array.astype(np.int32) for array in arrays))
