"""The loops of `_springs` over pixels, compiled by numba.

Every plane holds the networks of all levels one behind the other, row after row, zeros between
them; `right` and `down` of a pixel join it to the next.  So no loop asks where a row ends: what
lies beyond a border is held by a spring of no stiffness.  Loops over a row do nothing but
arithmetic on slices that begin at zero, which LLVM turns into vectors.

Importing numba takes half a second, so `_springs` imports this where the host solves, not above.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from tactograph.nodes import F4

if TYPE_CHECKING:
    from tactograph.nodes.height._springs import Grids

DAMPING = np.float32(0.7)
OVERSHOOT = np.float32(1.5)
"""Rigid blocks are too stiff: their correction is that much too small."""
RESTRICT, SOLVE, REDO, ADD, LIFT = range(5)
"""What `visits` of a cycle do."""
ONE, TINY = np.float32(1), np.float32(1e-30)


@njit(cache=True, nogil=True)
def coarsen(grids: Grids) -> None:
    """Enter the networks of 2 x 2 pixels joined rigidly, level after level; ties excepted."""
    for level in range(len(grids.places) - 1):
        first, rows, columns = grids.places[level]
        below, _, width = grids.places[level + 1]
        for row in range(rows):
            at, to = first + row * columns, below + row // 2 * width
            for column in range(columns):
                block = to + column // 2
                grids.ground[block] += grids.ground[at + column]
                if column % 2:
                    grids.right[block] += grids.right[at + column]
                if row % 2:
                    grids.down[block] += grids.down[at + column]


@njit(cache=True, nogil=True)
def prepare(grids: Grids) -> None:
    """Enter one over the diagonal of each level's matrix, times the damping."""
    total = np.zeros_like(grids.relax)
    for first, rows, columns in grids.places:
        size = rows * columns
        for pixel in range(first, first + size):
            across = grids.right[pixel] + grids.right[pixel - 1]
            total[pixel] = (
                grids.ground[pixel] + across + grids.down[pixel] + grids.down[pixel - columns]
            )
    for tie in range(grids.ties.stiffness.size):
        total[grids.ties.top[tie]] += grids.ties.stiffness[tie]
        total[grids.ties.foot[tie]] += grids.ties.stiffness[tie]
    for pixel in range(total.size):
        if total[pixel] > 0:
            grids.relax[pixel] = DAMPING * (ONE / max(total[pixel], TINY))


@njit(cache=True, nogil=True)
def matrix(grids: Grids, level: int) -> F4:
    """The matrix of the normal equations of a level."""
    first, rows, columns = grids.places[level]
    size = rows * columns
    made = np.empty((size, size), np.float32)
    unit, force = np.zeros_like(grids.right), np.empty_like(grids.right)
    for pixel in range(size):
        unit[first + pixel] = ONE
        apply(grids, level, unit, force)
        made[pixel] = force[first : first + size]
        unit[first + pixel] = 0
    return made


@njit(cache=True, nogil=True)
def pull(right: F4, down: F4, wants_right: F4, wants_down: F4, force: F4) -> None:
    """Add to `force` (H x W) that of springs between neighbours which want these steps."""
    for row in range(force.shape[0]):
        here, stiff, want = force[row], right[row], wants_right[row]
        after = here[1:]
        for column in range(stiff.size):
            here[column] -= stiff[column] * want[column]
        for column in range(stiff.size):
            after[column] += stiff[column] * want[column]
        if row < down.shape[0]:
            stiff, want = down[row], wants_down[row]
            for column in range(stiff.size):
                here[column] -= stiff[column] * want[column]
        if row > 0:
            stiff, want = down[row - 1], wants_down[row - 1]
            for column in range(stiff.size):
                here[column] += stiff[column] * want[column]


@njit(cache=True, nogil=True)
def apply(grids: Grids, level: int, height: F4, force: F4) -> None:
    """Enter in `force` the matrix of a level's normal equations times `height`."""
    first, rows, columns = grids.places[level]
    for at in range(first, first + rows * columns, columns):
        _hold(grids, height, at, columns, force[at : at + columns])
    for tie in range(grids.ties.start[level], grids.ties.start[level + 1]):
        top, foot = grids.ties.top[tie], grids.ties.foot[tie]
        stretch = grids.ties.stiffness[tie] * (height[top] - height[foot])
        force[top] += stretch
        force[foot] -= stretch


@njit(cache=True, nogil=True)
def _hold(grids: Grids, height: F4, at: int, width: int, force: F4) -> None:
    """The force of a row whose first pixel is `at`, ties excepted."""
    end = at + width
    here, before, after = height[at:end], height[at - 1 : end - 1], height[at + 1 : end + 1]
    above, below = height[at - width : at], height[end : end + width]
    rightwards, leftwards = grids.right[at:end], grids.right[at - 1 : end - 1]
    downwards, upwards = grids.down[at:end], grids.down[at - width : at]
    ground = grids.ground[at:end]
    for column in range(width):
        z = here[column]
        across = leftwards[column] * (z - before[column]) + rightwards[column] * (z - after[column])
        along = upwards[column] * (z - above[column]) + downwards[column] * (z - below[column])
        force[column] = ground[column] * z + across + along


@njit(cache=True, nogil=True)
def _relax(grids: Grids, force: F4, at: int, width: int, height: F4) -> None:
    """A step of Jacobi from height zero, in a row."""
    end = at + width
    relax, pulled, there = grids.relax[at:end], force[at:end], height[at:end]
    for column in range(width):
        there[column] = relax[column] * pulled[column]


@njit(cache=True, nogil=True)
def _restrict(grids: Grids, level: int, force: F4, height: F4) -> None:
    """Relax a level, and enter in `force` of the coarser what is then left, by 2 x 2 pixels."""
    first, rows, columns = grids.places[level]
    below, _, width = grids.places[level + 1]
    held, left = np.empty(columns, np.float32), np.zeros(2 * width, np.float32)
    _relax(grids, force, first, columns, height)
    for row in range(rows):
        at = first + row * columns
        if row + 1 < rows:
            _relax(grids, force, at + columns, columns, height)
        _hold(grids, height, at, columns, held)
        pulled = force[at : at + columns]
        if row % 2 == 0:
            for column in range(columns):
                left[column] = pulled[column] - held[column]
        else:
            for column in range(columns):
                left[column] += pulled[column] - held[column]
        if row % 2 or row + 1 == rows:
            to = below + row // 2 * width
            blocks = force[to : to + width]
            for block in range(width):
                blocks[block] = left[2 * block] + left[2 * block + 1]
    ties = grids.ties
    for tie in range(ties.start[level], ties.start[level + 1]):
        stretch = ties.stiffness[tie] * (height[ties.top[tie]] - height[ties.foot[tie]])
        force[ties.top_block[tie]] -= stretch
        force[ties.foot_block[tie]] += stretch


@njit(cache=True, nogil=True)
def _lift_row(grids: Grids, level: int, row: int, coarse: F4, height: F4) -> None:
    """Every pixel of a block moves as the block does, in a row."""
    first, _, columns = grids.places[level]
    below, _, width = grids.places[level + 1]
    at, to = first + row * columns, below + row // 2 * width
    there, moved = height[at : at + columns], coarse[to : to + width]
    pairs = columns // 2
    for block in range(pairs):
        step = OVERSHOOT * moved[block]
        there[2 * block] += step
        there[2 * block + 1] += step
    if columns % 2:
        there[columns - 1] += OVERSHOOT * moved[pairs]


@njit(cache=True, nogil=True)
def _lift(grids: Grids, level: int, force: F4, height: F4, found: F4) -> None:
    """Move a level as the coarser in `found`, relax it once more, and enter it there."""
    first, rows, columns = grids.places[level]
    held = np.empty(columns, np.float32)
    _lift_row(grids, level, 0, found, height)
    for row in range(rows):
        if row + 1 < rows:
            _lift_row(grids, level, row + 1, found, height)
        at = first + row * columns
        end = at + columns
        _hold(grids, height, at, columns, held)
        pulled, relax, z, out = force[at:end], grids.relax[at:end], height[at:end], found[at:end]
        for column in range(columns):
            out[column] = z[column] + relax[column] * (pulled[column] - held[column])
    for tie in range(grids.ties.start[level], grids.ties.start[level + 1]):
        top, foot = grids.ties.top[tie], grids.ties.foot[tie]
        stretch = grids.ties.stiffness[tie] * (height[top] - height[foot])
        found[top] -= grids.relax[top] * stretch
        found[foot] += grids.relax[foot] * stretch


@njit(cache=True, nogil=True)
def _solve_directly(grids: Grids, force: F4, found: F4) -> None:
    """The smallest network, by its inverse, which is symmetric."""
    first, rows, columns = grids.places[-1]
    size = rows * columns
    out = found[first : first + size]
    out[:] = 0
    for pixel in range(size):
        row, pulled = grids.dense[pixel], force[first + pixel]
        for other in range(size):
            out[other] += row[other] * pulled


@njit(cache=True, nogil=True)
def cycle(grids: Grids, force: F4, found: F4, height: F4, kept: F4) -> None:
    """Enter in `found` the heights that about balance `force`: one symmetric multigrid cycle.

    `force` of the coarser levels changes; `height` and `kept` are room to work in.
    """
    for what, level in grids.visits:
        first, rows, columns = grids.places[level]
        end = first + rows * columns
        if what == RESTRICT:
            _restrict(grids, level, force, height)
        elif what == SOLVE:
            _solve_directly(grids, force, found)
        elif what == LIFT:
            _lift(grids, level, force, height, found)
        elif what == REDO:
            kept[first:end] = found[first:end]
            apply(grids, level, found, height)
            _subtract(force[first:end], height[first:end], ONE)
        else:
            _subtract(found[first:end], kept[first:end], -ONE)


@njit(cache=True, nogil=True)
def _subtract(plane: F4, other: F4, times: np.float32) -> None:
    """Take so many times the other from a plane."""
    for pixel in range(plane.size):
        plane[pixel] -= times * other[pixel]


@njit(cache=True, nogil=True)
def advance(height: F4, left: F4, direction: F4, moved: F4, length: np.float32) -> None:
    """Go so far in a direction; `moved` is the matrix times it, `left` the force that is left."""
    _subtract(height, direction, -length)
    _subtract(left, moved, length)


@njit(cache=True, nogil=True)
def turn(direction: F4, correction: F4, share: np.float32) -> None:
    """The next direction: the correction, and a share of the direction before."""
    for pixel in range(direction.size):
        direction[pixel] = correction[pixel] + share * direction[pixel]
