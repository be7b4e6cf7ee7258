"""Heights as a network of springs, and its solution by conjugate gradients and multigrid.

Weighted least squares of height differences is a network of springs: between neighbours,
between the two ends of each shadow, and to the ground.  Joining 2 x 2 pixels rigidly gives
the same kind of network, four times smaller, every stiffness the sum of those it replaces.
That is the whole multigrid, which preconditions the conjugate gradients.  It copes with weights
that differ by orders of magnitude; a transform that ignores the weights does not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4

SMALLEST = 128
SINGLE_VISITS = 2
"""How many of the finest networks are visited once a cycle; the coarser ones twice."""


Pixels = NDArray[np.int64]
"""Flat indices."""


class Ties(NamedTuple):
    """Springs between distant pixels, one per shadow."""

    top: Pixels
    foot: Pixels
    stiffness: F4


class Springs:
    """A network: `right` (H x W-1) and `down` (H-1 x W) join neighbours, `ground` (H x W)."""

    def __init__(self, right: F4, down: F4, ground: F4, ties: Ties) -> None:
        self.right, self.down, self.ground, self.ties = right, down, ground, ties
        self.shape = ground.shape

    def pull(self, right: F4, down: F4, rise: F4) -> F4:
        """Force on each pixel for these target differences of height."""
        from tactograph.nodes.height import _spring_loops as loops

        force = np.zeros(self.shape, np.float32)
        loops.pull(self.right, self.down, right, down, force)
        if rise.size:
            stretch = self.ties.stiffness * rise
            np.add.at(force.ravel(), self.ties.top, stretch)
            np.subtract.at(force.ravel(), self.ties.foot, stretch)
        return force

    def energy(self, right: F4, down: F4) -> float:
        """Energy of the springs between neighbours at height zero, for these target steps.

        Twice the energy, to be exact; the scale for what is left to gain.
        """
        return float(np.vdot(self.right * right, right) + np.vdot(self.down * down, down))


class LevelTies(NamedTuple):
    """The ties of all levels, one after another; pixels are counted in the planes of `Grids`."""

    start: Pixels
    """The first tie of each level, and how many there are."""
    top: Pixels
    foot: Pixels
    stiffness: F4
    top_block: Pixels
    """The pixels of the coarser level that hold the ends."""
    foot_block: Pixels


class Grids(NamedTuple):
    """A network and its coarser ones down to a few pixels, each of 2 x 2 pixels of the one before.

    Planes hold all levels, one after another.
    """

    places: NDArray[np.int64]
    """Levels x 3: where in the planes each begins, its rows and columns."""
    right: F4
    down: F4
    ground: F4
    relax: F4
    """One over the diagonal of the matrix, times the damping of Jacobi's steps."""
    ties: LevelTies
    dense: F4
    """The inverse matrix of the smallest network."""
    visits: NDArray[np.int64]
    """What a cycle does at which level, one after another (`_spring_loops`)."""

    @property
    def shape(self) -> tuple[int, int]:
        return int(self.places[0, 1]), int(self.places[0, 2])

    def apply(self, height: F4, level: int = 0) -> F4:
        """The matrix of a level's normal equations times `height`."""
        from tactograph.nodes.height import _spring_loops as loops

        first, rows, columns = self.places[level]
        planes = np.zeros((2, self.right.size), np.float32)
        planes[0, first : first + rows * columns] = height.ravel()
        loops.apply(self, level, *planes)
        return planes[1, first : first + rows * columns].reshape(rows, columns)


def hierarchy(springs: Springs) -> Grids:
    """The network and its coarser ones down to a few pixels."""
    # Imported here: importing numba takes half a second, and a device does not need it.
    from tactograph.nodes.height import _spring_loops as loops

    places = _places(*springs.shape)
    first, rows, columns = places[0]
    planes = np.zeros((4, places[-1, 0] + (places[-1, 1] + 1) * places[-1, 2]), np.float32)
    finest = planes[:, first : first + rows * columns].reshape(4, rows, columns)
    finest[0, :, :-1], finest[1, :-1], finest[2] = springs.right, springs.down, springs.ground
    nothing = np.zeros((0, 0), np.float32)
    ties, visits = _tied(springs.ties, places), _visits(len(places))
    grids = Grids(places, planes[0], planes[1], planes[2], planes[3], ties, nothing, visits)
    loops.coarsen(grids)
    loops.prepare(grids)
    return grids._replace(dense=soft_inverse(_smallest_matrix(grids)))


def _places(rows: int, columns: int) -> NDArray[np.int64]:
    """Where the levels of a network begin, with room for a row before and after each."""
    places = [(columns, rows, columns)]
    while rows * columns > SMALLEST:
        end = places[-1][0] + (rows + 1) * columns
        rows, columns = (rows + 1) // 2, (columns + 1) // 2
        places.append((end, rows, columns))
    return np.array(places, np.int64)


def _visits(levels: int) -> NDArray[np.int64]:
    """What a multigrid cycle does, and where."""
    from tactograph.nodes.height import _spring_loops as loops

    def cycle(level: int) -> list[tuple[int, int]]:
        below = level + 1
        if below == levels:
            return [(loops.SOLVE, level)]
        visits = [(loops.RESTRICT, level), *cycle(below)]
        if below >= SINGLE_VISITS and below + 1 < levels:
            visits += [(loops.REDO, below), *cycle(below), (loops.ADD, below)]
        return [*visits, (loops.LIFT, level)]

    return np.array(cycle(0), np.int64)


def _tied(ties: Ties, places: NDArray[np.int64]) -> LevelTies:
    """The ties of all levels."""
    levels: list[Ties] = []
    blocks: list[list[Pixels]] = []
    starts = [0]
    for level, (first, _, columns) in enumerate(places):
        levels.append(Ties(ties.top + first, ties.foot + first, ties.stiffness))
        starts.append(starts[-1] + ties.top.size)
        if level + 1 < len(places):
            below, *half = (int(number) for number in places[level + 1])
            blocks.append(
                [below + blocks_of(index, int(columns), half[1]) for index in (ties.top, ties.foot)]
            )
            ties = coarser_ties(ties, int(columns), (half[0], half[1]))
    blocks.append([np.zeros(ties.top.size, np.int64)] * 2)
    tops, feet, stiffness = map(np.concatenate, zip(*levels, strict=True))
    top_blocks, foot_blocks = map(np.concatenate, zip(*blocks, strict=True))
    start = np.array(starts, np.int64)
    return LevelTies(start, tops, feet, stiffness, top_blocks, foot_blocks)


def coarser_ties(ties: Ties, width: int, half: tuple[int, int]) -> Ties:
    """The ties between blocks of 2 x 2 pixels, each as stiff as all those that it joins."""
    top, foot, which = join_ends(ties.top, ties.foot, width, half)
    apart = which >= 0
    stiffness = np.bincount(which[apart], ties.stiffness[apart], len(top))
    return Ties(top, foot, stiffness.astype(np.float32))


def blocks_of(index: Pixels, width: int, half: int) -> Pixels:
    """The blocks of 2 x 2 that hold pixels of a network `width` pixels wide; `half` in a row."""
    return index // width // 2 * half + index % width // 2


def join_ends(top: Pixels, foot: Pixels, width: int, half: tuple[int, int]) -> tuple[Pixels, ...]:
    """The ends of ties in a network of half the size, and the number of the one each joins.

    A tie whose ends become one pixel joins none: -1.
    """
    size = half[0] * half[1]
    top, foot = (blocks_of(index, width, half[1]) for index in (top, foot))
    apart = top != foot
    which = np.full(top.size, -1, np.int64)
    pairs = top[apart] * size + foot[apart]
    order = stable_order(pairs)
    first = np.diff(pairs[order], prepend=-1) > 0
    which[np.flatnonzero(apart)[order]] = np.cumsum(first) - 1
    pairs = pairs[order][first]
    return pairs // size, pairs % size, which


def stable_order(keys: Pixels) -> Pixels:
    """The stable `np.argsort`, by the fast sort of distinct numbers."""
    bits = keys.size.bit_length()
    if keys.size and int(keys.max()) >> (63 - bits):
        return np.argsort(keys, kind="stable")  # numbered, they would not fit
    numbered = (keys.astype(np.int64) << bits) + np.arange(keys.size)
    numbered.sort()
    return numbered & ((1 << bits) - 1)


def _smallest_matrix(grids: Grids) -> F4:
    """The matrix of the normal equations of the coarsest level."""
    first, rows, columns = (int(number) for number in grids.places[-1])
    size, start = rows * columns, int(grids.ties.start[-2])
    end = first + size
    here, ties = np.arange(size), grids.ties
    ends = np.concatenate([here[:-1], here[:-columns], ties.top[start:] - first])
    others = np.concatenate([here[1:], here[columns:], ties.foot[start:] - first])
    right, down = grids.right[first : end - 1], grids.down[first : end - columns]
    stiffness = np.concatenate([right, down, ties.stiffness[start:]])
    matrix = np.diag(grids.ground[first:end])
    np.subtract.at(matrix, (ends, others), stiffness)
    np.subtract.at(matrix, (others, ends), stiffness)
    np.add.at(matrix, (ends, ends), stiffness)
    np.add.at(matrix, (others, others), stiffness)
    return matrix


def soft_inverse(matrix: F4) -> F4:
    """The inverse of a network's matrix, slightly regularised; pixels joined to nothing stay.

    If nothing holds the others to the ground, they are kept from moving as a whole: rounding
    alone would move them far.
    """
    joined = np.diag(matrix) > 0
    if not joined.all():
        inside = np.ix_(joined, joined)
        inverse = np.zeros_like(matrix)
        if joined.any():
            inverse[inside] = soft_inverse(matrix[inside])
        return inverse
    size, held = len(matrix), matrix.astype(float)
    stiffness = float(np.trace(held)) / size
    held.flat[:: size + 1] += 1e-7 * stiffness
    if held.sum() > 1e-5 * stiffness * size:
        return np.linalg.inv(held).astype(np.float32)
    keep = np.eye(size) - 1 / size
    return (keep @ np.linalg.inv(held + stiffness / size) @ keep).astype(np.float32)


def _padded(plane: F4, half: tuple[int, int]) -> F4:
    rows, columns = plane.shape
    return np.pad(plane, ((0, 2 * half[0] - rows), (0, 2 * half[1] - columns)))


def block_sums(plane: F4) -> F4:
    """Sums over 2 x 2 pixels; zero beyond an odd border."""
    rows, columns = plane.shape
    if (rows | columns) & 1:
        plane = _padded(plane, ((rows + 1) // 2, (columns + 1) // 2))
    return np.asarray(plane[0::2, 0::2] + plane[1::2, 0::2] + plane[0::2, 1::2] + plane[1::2, 1::2])


def conjugate_gradients(grids: Grids, force: F4, height: F4, steps: int, enough: float) -> F4:
    """Improve `height` until about `enough` energy is left to gain, in at most `steps` steps.

    If there is nothing to gain, the same array is returned.
    """
    from tactograph.nodes.height import _spring_loops as loops

    first, rows, columns = grids.places[0]
    planes = np.zeros((6, grids.right.size), np.float32)
    whole_left, whole_correction, whole_direction, whole_moved, *room = planes
    left, correction, direction, moved, *_ = planes[:, first : first + rows * columns]
    direction[:] = height.ravel()
    loops.apply(grids, 0, whole_direction, whole_moved)
    np.subtract(force.ravel(), moved, out=left)
    loops.cycle(grids, whole_left, whole_correction, *room)
    direction[:] = correction
    energy = float(np.vdot(left, correction))
    found = height
    for _ in range(steps):
        if energy <= enough or energy <= 0:
            break
        loops.apply(grids, 0, whole_direction, whole_moved)
        stretched = float(np.vdot(direction, moved))
        if stretched <= 0:
            break
        found = height.copy() if found is height else found
        loops.advance(found.ravel(), left, direction, moved, np.float32(energy / stretched))
        loops.cycle(grids, whole_left, whole_correction, *room)
        before, energy = energy, float(np.vdot(left, correction))
        loops.turn(direction, correction, np.float32(energy / before))
    return found
