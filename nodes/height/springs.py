"""Heights as a network of springs, and its solution by conjugate gradients and multigrid.

Weighted least squares of height differences is a network of springs: between neighbours,
between the two ends of each shadow, and to the ground.  Joining 2 x 2 pixels rigidly gives
the same kind of network, four times smaller; every stiffness is the sum of those it replaces.
These levels form the multigrid that preconditions the conjugate gradients.  It copes with weights
that differ by orders of magnitude; a transform that ignores the weights does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4

MAX_COARSEST_PIXELS = 32
"""A network of at most this many pixels needs no coarser one: smoothing suffices."""
SINGLE_VISITS = 2
"""How many of the finest, and of the coarsest, networks a cycle visits once; it visits those
between twice."""
JACOBI_DAMPING = np.float32(0.7)
BLOCK_OVERSHOOT = np.float32(1.5)
"""Factor on the correction of rigid blocks, which are too stiff and correct too little."""

MIN_TOTAL_STIFFNESS = np.float32(1e-30)

Pixels = NDArray[np.int64]
"""Flat indices."""


class Ties(NamedTuple):
    """Springs between distant pixels, one per shadow."""

    top: Pixels
    foot: Pixels
    stiffness: F4

    def joined(self, width: int, half: tuple[int, int]) -> tuple[Ties, Pixels]:
        """The ties of a network of half the size, and for each tie the coarser one that it joins.

        A tie whose ends become one pixel joins none (-1).
        """
        size = half[0] * half[1]
        top, foot = (end // width // 2 * half[1] + end % width // 2 for end in self[:2])
        apart = top != foot
        pairs, joins = np.unique(top[apart] * size + foot[apart], return_inverse=True)
        which = np.full(top.size, -1, np.int64)
        which[apart] = joins
        stiffness = np.bincount(joins, self.stiffness[apart], pairs.size).astype(np.float32)
        return Ties(pairs // size, pairs % size, stiffness), which


class Springs:
    """A network: `right` (H x W-1) and `down` (H-1 x W) join neighbours, `ground` (H x W)."""

    def __init__(self, right: F4, down: F4, ground: F4, ties: Ties) -> None:
        self.right, self.down, self.ground, self.ties = right, down, ground, ties
        self.shape = ground.shape

    def pull(self, right: F4, down: F4, rise: F4) -> F4:
        """The force on each pixel for these target differences of height."""
        force = np.zeros(self.shape, np.float32)
        across, along = self.right * right, self.down * down
        force[:, 1:] += across
        force[:, :-1] -= across
        force[1:] += along
        force[:-1] -= along
        stretch = self.ties.stiffness * rise
        np.add.at(force.ravel(), self.ties.top, stretch)
        np.subtract.at(force.ravel(), self.ties.foot, stretch)
        return force

    def apply(self, height: F4) -> F4:
        """The matrix of the normal equations times `height`."""
        flat = height.ravel()
        rise = flat[self.ties.top] - flat[self.ties.foot]
        force = self.pull(height[:, 1:] - height[:, :-1], height[1:] - height[:-1], rise)
        force += self.ground * height
        return force

    def energy(self, right: F4, down: F4) -> float:
        """Twice the energy of the springs between neighbours at height zero, for these steps.

        It is the scale for the gain that remains.
        """
        return float(np.vdot(self.right * right, right) + np.vdot(self.down * down, down))

    @cached_property
    def relax(self) -> F4:
        """One over the diagonal of the matrix, times the damping of Jacobi's steps."""
        total = self.ground.copy()
        total[:, 1:] += self.right
        total[:, :-1] += self.right
        total[1:] += self.down
        total[:-1] += self.down
        np.add.at(total.ravel(), self.ties.top, self.ties.stiffness)
        np.add.at(total.ravel(), self.ties.foot, self.ties.stiffness)
        damped = JACOBI_DAMPING / np.maximum(total, MIN_TOTAL_STIFFNESS)
        return np.where(total > 0, damped, np.float32(0))

    def coarser(self) -> Springs:
        """The network of blocks of 2 x 2 pixels, joined rigidly."""
        right, down = pair_sums(self.right[:, 1::2]), pair_sums(self.down[1::2].T).T
        ground = quad_sums(self.ground)
        return Springs(right, down, ground, self.ties.joined(self.shape[1], ground.shape)[0])


def pair_sums(rows: F4) -> F4:
    """The sums of pairs of rows; the last row of an odd number stays as it is."""
    sums = rows[0::2].copy(order="K")
    sums[: len(rows) // 2] += rows[1::2]
    return sums


def quad_sums(plane: F4) -> F4:
    """Sums over 2 x 2 pixels; zero beyond an odd border."""
    return pair_sums(pair_sums(plane).T).T


def hierarchy(springs: Springs) -> list[Springs]:
    """The network and its coarser networks, down to a few pixels."""
    levels = [springs]
    while levels[-1].ground.size > MAX_COARSEST_PIXELS:
        levels.append(levels[-1].coarser())
    return levels


def cycle(levels: Sequence[Springs], force: F4, depth: int = 0) -> F4:
    """Return heights that nearly balance `force`, by one symmetric multigrid cycle."""
    network, *coarser = levels
    height = network.relax * force
    if coarser:
        residual = quad_sums(force - network.apply(height))
        moved = cycle(coarser, residual, depth + 1)
        if depth + 1 >= SINGLE_VISITS and len(coarser) > SINGLE_VISITS:
            moved = moved + cycle(coarser, residual - coarser[0].apply(moved), depth + 1)
        # Every pixel of a block moves with the block.
        rows, columns = height.shape
        height += BLOCK_OVERSHOOT * moved.repeat(2, axis=0).repeat(2, axis=1)[:rows, :columns]
    height += network.relax * (force - network.apply(height))
    return height


def conjugate_gradients(
    levels: Sequence[Springs], force: F4, height: F4, steps: int, enough: float
) -> F4:
    """Improve `height` in at most `steps` steps, until the remaining gain is about `enough`.

    If nothing can be gained, the same array is returned.
    """
    matrix = levels[0]
    residual = force - matrix.apply(height)
    direction = correction = cycle(levels, residual)
    energy = float(np.vdot(residual, correction))
    for _ in range(steps):
        if energy <= enough or energy <= 0:
            break
        moved = matrix.apply(direction)
        stretched = float(np.vdot(direction, moved))
        if stretched <= 0:
            break
        length = np.float32(energy / stretched)
        height = height + length * direction
        residual = residual - length * moved
        correction = cycle(levels, residual)
        before, energy = energy, float(np.vdot(residual, correction))
        direction = correction + np.float32(energy / before) * direction
    return height
