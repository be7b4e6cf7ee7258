"""Heights as a network of springs, and its solution by conjugate gradients and multigrid.

Weighted least squares of height differences is a network of springs: between neighbours,
between the two ends of each shadow, and to the ground.  Joining 2 x 2 pixels rigidly gives
the same kind of network, four times smaller, every stiffness the sum of those it replaces.
That is all of the multigrid, which preconditions the conjugate gradients; it copes with
weights that differ by orders of magnitude, where a transform that knows no weights does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4

SMALLEST = 128
DAMPING = np.float32(0.7)
OVERSHOOT = np.float32(1.5)
"""Rigid blocks are too stiff: their correction is that much too small."""
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

    @cached_property
    def inverse_diagonal(self) -> F4:
        total = self.ground.copy()
        total[:, 1:] += self.right
        total[:, :-1] += self.right
        total[1:] += self.down
        total[:-1] += self.down
        np.add.at(total.ravel(), self.ties.top, self.ties.stiffness)
        np.add.at(total.ravel(), self.ties.foot, self.ties.stiffness)
        return np.where(total > 0, np.float32(1) / np.maximum(total, np.float32(1e-30)), 0)

    def pull(self, right: F4, down: F4, rise: F4) -> F4:
        """Force on each pixel when the springs want these differences of height."""
        force = np.zeros(self.shape, np.float32)
        stretch = self.right * right
        force[:, 1:] += stretch
        force[:, :-1] -= stretch
        stretch = self.down * down
        force[1:] += stretch
        force[:-1] -= stretch
        if rise.size:
            stretch = self.ties.stiffness * rise
            np.add.at(force.ravel(), self.ties.top, stretch)
            np.subtract.at(force.ravel(), self.ties.foot, stretch)
        return force

    def energy(self, right: F4, down: F4) -> float:
        """What the springs between neighbours hold at height zero when they want these steps.

        Twice the energy, to be exact; the measure of what is left to gain.
        """
        return float(np.vdot(self.right * right, right) + np.vdot(self.down * down, down))

    def apply(self, height: F4) -> F4:
        """The matrix of the normal equations times `height`."""
        flat = height.ravel()
        force = self.pull(
            height[:, 1:] - height[:, :-1],
            height[1:] - height[:-1],
            flat[self.ties.top] - flat[self.ties.foot],
        )
        force += self.ground * height
        return force

    def coarser(self) -> Springs:
        """The network of 2 x 2 pixels joined rigidly."""
        rows, columns = self.shape
        half = ((rows + 1) // 2, (columns + 1) // 2)
        right = _padded(self.right, half)
        down = _padded(self.down, half)
        joined_right = right[0::2, 1::2] + right[1::2, 1::2]
        joined_down = down[1::2, 0::2] + down[1::2, 1::2]
        return Springs(
            np.ascontiguousarray(joined_right[:, :-1]),
            np.ascontiguousarray(joined_down[:-1]),
            block_sums(self.ground),
            self._coarser_ties(half),
        )

    def _coarser_ties(self, half: tuple[int, int]) -> Ties:
        top, foot, which = join_ends(self.ties.top, self.ties.foot, self.shape[1], half)
        apart = which >= 0
        stiffness = np.bincount(which[apart], self.ties.stiffness[apart], len(top))
        return Ties(top, foot, stiffness.astype(np.float32))

    @cached_property
    def dense_inverse(self) -> F4:
        """The inverse matrix; only for the smallest network."""
        size = self.ground.size
        units = np.eye(size, dtype=np.float32).reshape(size, *self.shape)
        return soft_inverse(np.stack([self.apply(unit).ravel() for unit in units], axis=1))


def join_ends(top: Pixels, foot: Pixels, width: int, half: tuple[int, int]) -> tuple[Pixels, ...]:
    """The ends of ties in a network of half the size, and the number of the one each joins.

    A tie whose ends become one pixel joins none: -1.
    """
    size = half[0] * half[1]
    top, foot = (index // width // 2 * half[1] + index % width // 2 for index in (top, foot))
    apart = top != foot
    which = np.full(top.size, -1, np.int64)
    pairs = top[apart] * size + foot[apart]
    order = stable_order(pairs)
    first = np.diff(pairs[order], prepend=-1) > 0
    which[np.flatnonzero(apart)[order]] = np.cumsum(first) - 1
    pairs = pairs[order][first]
    return pairs // size, pairs % size, which


def stable_order(keys: Pixels) -> Pixels:
    """The stable `np.argsort`, by the fast sort of numbers of which no two are alike."""
    numbered = keys.astype(np.int64) * keys.size + np.arange(keys.size)
    numbered.sort()
    return numbered % max(keys.size, 1)


def soft_inverse(matrix: F4) -> F4:
    """The inverse of a network's matrix, a little softened; pixels joined to nothing stay.

    Where nothing holds the others either, they are kept from moving as a whole: rounding
    alone would move them far.
    """
    joined = np.diag(matrix) > 0
    size = int(joined.sum())
    inside = np.ix_(joined, joined)
    inverse = np.zeros_like(matrix)
    if size:
        stiffness = float(np.trace(matrix, dtype=float)) / size
        held = matrix[inside] + np.eye(size) * (1e-7 * stiffness)
        if held.sum() > 1e-5 * stiffness * size:
            inverse[inside] = np.linalg.inv(held)
        else:
            keep = np.eye(size) - 1 / size
            inverse[inside] = keep @ np.linalg.inv(held + stiffness / size) @ keep
    return inverse


def _padded(plane: F4, half: tuple[int, int]) -> F4:
    rows, columns = plane.shape
    return np.pad(plane, ((0, 2 * half[0] - rows), (0, 2 * half[1] - columns)))


def block_sums(plane: F4) -> F4:
    """Sums over 2 x 2 pixels; zero beyond an odd border."""
    rows, columns = plane.shape
    if (rows | columns) & 1:
        plane = _padded(plane, ((rows + 1) // 2, (columns + 1) // 2))
    return np.asarray(plane[0::2, 0::2] + plane[1::2, 0::2] + plane[0::2, 1::2] + plane[1::2, 1::2])


def _spread(coarse: F4, shape: tuple[int, ...]) -> F4:
    """Every pixel of a block moves as the block does."""
    return coarse.repeat(2, axis=0).repeat(2, axis=1)[: shape[0], : shape[1]]


def hierarchy(springs: Springs) -> list[Springs]:
    """The network and its coarser ones down to a few pixels."""
    levels = [springs]
    while levels[-1].ground.size > SMALLEST:
        levels.append(levels[-1].coarser())
    return levels


def cycle(levels: Sequence[Springs], force: F4, depth: int = 0) -> F4:
    """Return the heights that about balance `force`: one symmetric multigrid cycle."""
    network = levels[0]
    if len(levels) == 1:
        return (network.dense_inverse @ force.ravel()).reshape(force.shape)
    height = DAMPING * network.inverse_diagonal * force
    left = block_sums(force - network.apply(height))
    coarse = cycle(levels[1:], left, depth + 1)
    if depth + 1 >= SINGLE_VISITS and len(levels) > 2:
        coarse = coarse + cycle(levels[1:], left - levels[1].apply(coarse), depth + 1)
    height = height + OVERSHOOT * _spread(coarse, height.shape)
    height += DAMPING * network.inverse_diagonal * (force - network.apply(height))
    return height


def conjugate_gradients(
    levels: Sequence[Springs], force: F4, height: F4, steps: int, enough: float
) -> F4:
    """Improve `height` until about `enough` energy is left to gain, `steps` times at most."""
    left = force - levels[0].apply(height)
    correction = cycle(levels, left)
    direction = correction
    energy = float(np.vdot(left, correction))
    for _ in range(steps):
        if energy <= enough or energy <= 0:
            break
        moved = levels[0].apply(direction)
        stretched = float(np.vdot(direction, moved))
        if stretched <= 0:
            break
        length = np.float32(energy / stretched)
        height = height + length * direction
        left = left - length * moved
        correction = cycle(levels, left)
        before, energy = energy, float(np.vdot(left, correction))
        direction = correction + np.float32(energy / before) * direction
    return height
