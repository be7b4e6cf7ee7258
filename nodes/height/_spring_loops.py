"""The loops of `_springs` over pixels, compiled by numba.

Every plane holds the networks of all levels one after another, row by row, with zeros between
them; `right` and `down` of a pixel join it to the next.  So no loop tests where a row ends: a
spring across a border has no stiffness.  Loops over a row do nothing but arithmetic on slices
that begin at zero, which LLVM vectorises.

Importing numba takes half a second, so `_springs` imports this where the host solves, not above.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes._compiled import NOTHING, compiled

if TYPE_CHECKING:
    from tactograph.nodes.height._springs import Grids, LevelTies, Pixels

DAMPING = np.float32(0.7)
OVERSHOOT = np.float32(1.5)
"""Rigid blocks are too stiff: their correction is too small by this factor."""
RESTRICT, SOLVE, REDO, ADD, LIFT = range(5)
"""The operations in the `visits` of a cycle."""
ZERO, ONE, TINY = np.float32(0), np.float32(1), np.float32(1e-30)


@compiled
def coarsen(grids: Grids) -> None:
    """Enter the networks of rigid blocks of 2 x 2 pixels, level by level, except ties."""
    for level in range(len(grids.places) - 1):
        first, rows, columns = grids.places[level]
        below, _, width = grids.places[level + 1]
        for row in range(rows):
            at, to = first + row * columns, below + row // 2 * width
            _add_pairs(grids.ground, at, columns, to)
            _add_seconds(grids.right, at, columns, to)
            if row % 2:
                _add_pairs(grids.down, at, columns, to)


@compiled
def _add_pairs(plane: F4, at: int, width: int, to: int) -> None:
    """Add each two pixels of a row to a block; the first pixel is `at`, the first block `to`."""
    one, two, first, block = np.uintp(1), np.uintp(2), np.uintp(at), np.uintp(to)
    for pair in range(np.uintp(width // 2)):
        left = first + two * pair
        plane[block + pair] += plane[left] + plane[left + one]
    if width % 2:
        plane[to + width // 2] += plane[at + width - 1]


@compiled
def _add_seconds(plane: F4, at: int, width: int, to: int) -> None:
    """Add the second of each two pixels of a row to a block."""
    two, second, block = np.uintp(2), np.uintp(at + 1), np.uintp(to)
    for pair in range(np.uintp(width // 2)):
        plane[block + pair] += plane[second + two * pair]


@compiled
def prepare(grids: Grids) -> None:
    """Enter the damping divided by the diagonal of each level's matrix."""
    ties, relax = grids.ties, grids.relax
    for first, rows, columns in grids.places:
        _add_up(grids.right, grids.down, grids.ground, first, rows * columns, columns, relax)
    for tie in range(ties.stiffness.size):
        relax[ties.top[tie]] += ties.stiffness[tie]
        relax[ties.foot[tie]] += ties.stiffness[tie]
    for pixel in range(relax.size):
        total = relax[pixel]
        relax[pixel] = DAMPING * (ONE / max(total, TINY)) if total > 0 else ZERO


@compiled
def _add_up(right: F4, down: F4, ground: F4, at: int, size: int, width: int, total: F4) -> None:
    """The stiffness of all springs that hold each pixel of a level, except ties."""
    one, columns = np.uintp(1), np.uintp(width)
    for here in range(np.uintp(at), np.uintp(at + size)):
        across, along = right[here] + right[here - one], down[here] + down[here - columns]
        total[here] = ground[here] + across + along


@compiled
def pull(right: F4, down: F4, wants_right: F4, wants_down: F4, force: F4) -> None:
    """Add to `force` (H x W) that of springs between neighbours with these target steps."""
    for row in range(force.shape[0]):
        here, below = force[row], force[min(row + 1, down.shape[0])]
        stiff, want = right[row], wants_right[row]
        for column in range(stiff.size):
            here[column] -= stiff[column] * want[column]
        after = here[1:]
        for column in range(stiff.size):
            after[column] += stiff[column] * want[column]
        if row < down.shape[0]:
            stiff, want = down[row], wants_down[row]
            for column in range(stiff.size):
                stretch = stiff[column] * want[column]
                here[column] -= stretch
                below[column] += stretch


@compiled
def apply(grids: Grids, level: int, height: F4, force: F4) -> None:
    """Enter in `force` the matrix of a level's normal equations times `height`."""
    first, rows, columns = grids.places[level]
    for at in range(first, first + rows * columns, columns):
        _hold(height, grids.right, grids.down, grids.ground, at, columns, force, NOTHING)
    _stretch(grids.ties, level, height, force, grids.ties.top, grids.ties.foot, ONE)


@compiled
def _stretch(
    ties: LevelTies, level: int, height: F4, force: F4, top: Pixels, foot: Pixels, times: np.float32
) -> None:
    """Add to `force`, at `top` and `foot`, the force of a level's ties, times `times`."""
    for tie in range(ties.start[level], ties.start[level + 1]):
        pulled = times * ties.stiffness[tie] * (height[ties.top[tie]] - height[ties.foot[tie]])
        force[top[tie]] += pulled
        force[foot[tie]] -= pulled


@compiled
def _hold(
    height: F4, right: F4, down: F4, ground: F4, at: int, width: int, force: F4, behind: int
) -> None:
    """The force on a row whose first pixel is `at`, except ties; `behind` places earlier there."""
    one, columns, shift = np.uintp(1), np.uintp(width), np.uintp(behind)
    for here in range(np.uintp(at), np.uintp(at + width)):
        left, above, z = here - one, here - columns, height[here]
        across = right[left] * (z - height[left]) + right[here] * (z - height[here + one])
        along = down[above] * (z - height[above]) + down[here] * (z - height[here + columns])
        force[here - shift] = ground[here] * z + across + along


@compiled
def _relax(relax: F4, force: F4, at: int, width: int, height: F4) -> None:
    """A Jacobi step from height zero, in a row."""
    for here in range(np.uintp(at), np.uintp(at + width)):
        height[here] = relax[here] * force[here]


@compiled
def _restrict(grids: Grids, level: int, force: F4, height: F4) -> None:
    """Relax a level, and enter in `force` of the coarser one the residual, by 2 x 2 pixels."""
    first, rows, columns = grids.places[level]
    below, _, width = grids.places[level + 1]
    held = np.zeros(columns, np.float32)
    _clear(force[below : below + (rows + 1) // 2 * width])
    _relax(grids.relax, force, first, columns, height)
    for row in range(rows):
        at = first + row * columns
        if row + 1 < rows:
            _relax(grids.relax, force, at + columns, columns, height)
        _hold(height, grids.right, grids.down, grids.ground, at, columns, held, at)
        _join(force, held, at, columns, below + row // 2 * width)
    ties = grids.ties
    _stretch(ties, level, height, force, ties.top_block, ties.foot_block, -ONE)


@compiled
def _join(force: F4, held: F4, at: int, width: int, to: int) -> None:
    """Add the residual force on a row to its blocks, the first of which is `to`."""
    one, two, first, block = np.uintp(1), np.uintp(2), np.uintp(at), np.uintp(to)
    for pair in range(np.uintp(width // 2)):
        left = two * pair
        right = left + one
        both = (force[first + left] - held[left]) + (force[first + right] - held[right])
        force[block + pair] += both
    if width % 2:
        force[to + width // 2] += force[at + width - 1] - held[width - 1]


@compiled
def _lift_row(coarse: F4, to: int, at: int, width: int, height: F4) -> None:
    """Every pixel of a block moves as the block does, in a row."""
    one, two, first, block = np.uintp(1), np.uintp(2), np.uintp(at), np.uintp(to)
    for pair in range(np.uintp(width // 2)):
        left = first + two * pair
        step = OVERSHOOT * coarse[block + pair]
        height[left] += step
        height[left + one] += step
    if width % 2:
        height[at + width - 1] += OVERSHOOT * coarse[to + width // 2]


@compiled
def _lift(grids: Grids, level: int, force: F4, height: F4, found: F4) -> None:
    """Correct a level by the coarser one in `found`, relax it again, and enter it there."""
    first, rows, columns = grids.places[level]
    below, _, width = grids.places[level + 1]
    held = np.empty(columns, np.float32)
    _lift_row(found, below, first, columns, height)
    for row in range(rows):
        at = first + row * columns
        if row + 1 < rows:
            to = below + (row + 1) // 2 * width
            _lift_row(found, to, at + columns, columns, height)
        _hold(height, grids.right, grids.down, grids.ground, at, columns, held, at)
        _relax_again(grids.relax, force, held, at, columns, height, found)
    ties = grids.ties
    for tie in range(ties.start[level], ties.start[level + 1]):
        top, foot = ties.top[tie], ties.foot[tie]
        stretch = ties.stiffness[tie] * (height[top] - height[foot])
        found[top] -= grids.relax[top] * stretch
        found[foot] += grids.relax[foot] * stretch


@compiled
def _relax_again(
    relax: F4, force: F4, held: F4, at: int, width: int, height: F4, found: F4
) -> None:
    """A Jacobi step from a height at which the springs' force is `held`, in a row."""
    first = np.uintp(at)
    for here in range(first, np.uintp(at + width)):
        found[here] = height[here] + relax[here] * (force[here] - held[here - first])


@compiled
def _solve_directly(grids: Grids, force: F4, found: F4) -> None:
    """Solve the smallest network by its inverse, which is symmetric."""
    first, rows, columns = grids.places[-1]
    size = rows * columns
    out = found[first : first + size]
    _clear(out)
    for pixel in range(size):
        row, pulled = grids.dense[pixel], force[first + pixel]
        for other in range(size):
            out[other] += row[other] * pulled


@compiled
def cycle(grids: Grids, force: F4, found: F4, height: F4, kept: F4) -> None:
    """Enter in `found` the heights that nearly balance `force`: one symmetric multigrid cycle.

    `force` of the coarser levels changes; `height` and `kept` are working arrays.
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
            _clear(kept[first:end])
            _subtract(kept[first:end], found[first:end], -ONE)
            apply(grids, level, found, height)
            _subtract(force[first:end], height[first:end], ONE)
        else:
            _subtract(found[first:end], kept[first:end], -ONE)


@compiled
def _clear(plane: F4) -> None:
    """Set to zero; assigning to a slice would take seconds to compile."""
    for pixel in range(plane.size):
        plane[pixel] = ZERO


@compiled
def _subtract(plane: F4, other: F4, times: np.float32) -> None:
    """Subtract `times` times the other plane from a plane."""
    for pixel in range(plane.size):
        plane[pixel] -= times * other[pixel]


@compiled
def advance(height: F4, left: F4, direction: F4, moved: F4, length: np.float32) -> None:
    """Go `length` in a direction; `moved` is the matrix times it, `left` the residual force."""
    _subtract(height, direction, -length)
    _subtract(left, moved, length)


@compiled
def turn(direction: F4, correction: F4, share: np.float32) -> None:
    """The next direction: the correction, plus a share of the previous direction."""
    for pixel in range(direction.size):
        direction[pixel] = correction[pixel] + share * direction[pixel]
