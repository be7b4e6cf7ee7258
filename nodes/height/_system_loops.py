"""The loops of `_height_system` over pixels, compiled by numba: steps, variances and stiffness.

Importing numba takes half a second, so this is imported where the host gathers its equations.
"""

from __future__ import annotations

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes._compiled import compiled

KNOWN = np.float32(1e6)
SMOOTH = np.float32(1)
LONELY = np.float32(4)
WALL = np.float32(1e3)
ZERO, HALF, QUARTER = np.float32(0), np.float32(0.5), np.float32(0.25)
PARTS = np.float32(16)


@compiled
def steps_right(
    first: int,
    last: int,
    slope: F4,
    variance: F4,
    bend: np.float32,
    floor: np.float32,
    size: np.float32,
    step: F4,
    spread: F4,
) -> None:
    """Enter the steps to the right in some rows, in mm, and their variances; size is mm per px."""
    count = slope.shape[1] - 1
    more = np.zeros(count, np.float32)
    for row in range(first, last):
        p, v = slope[row], variance[row]
        if count > 2:
            _curve(p, p[1:], p[2:], p[3:], v, v[3:], more[1 : count - 1])
        _steps(p, p[1:], v, v[1:], more, bend, floor, size, step[row], spread[row])


@compiled
def steps_down(
    first: int,
    last: int,
    slope: F4,
    variance: F4,
    bend: np.float32,
    floor: np.float32,
    size: np.float32,
    step: F4,
    spread: F4,
) -> None:
    """Enter the steps from some rows downwards, likewise."""
    rows, columns = slope.shape
    more = np.zeros(columns, np.float32)
    for row in range(first, last):
        if 0 < row < rows - 2:
            above, here, below, end = slope[row - 1], slope[row], slope[row + 1], slope[row + 2]
            _curve(above, here, below, end, variance[row - 1], variance[row + 2], more)
        else:
            for c in range(columns):
                more[c] = ZERO
        _steps(
            slope[row], slope[row + 1], variance[row], variance[row + 1], more, bend, floor, size,
            step[row], spread[row],
        )  # fmt: skip


@compiled
def _curve(
    first: F4, second: F4, third: F4, fourth: F4, of_first: F4, of_fourth: F4, more: F4
) -> None:
    """What four slopes add to the mean of the inner two; at most a quarter of their difference."""
    for c in range(more.size):
        curve = (second[c] + third[c] - (first[c] + fourth[c])) / PARTS
        limit = QUARTER * abs(third[c] - second[c])
        smooth = (of_first[c] < SMOOTH) & (of_fourth[c] < SMOOTH)
        more[c] = min(max(curve, -limit), limit) if smooth else ZERO


@compiled
def _steps(
    before: F4,
    after: F4,
    of_before: F4,
    of_after: F4,
    more: F4,
    bend: np.float32,
    floor: np.float32,
    size: np.float32,
    step: F4,
    spread: F4,
) -> None:
    """The steps between slopes and those after them, and their variances."""
    for c in range(step.size):
        a, b, u, v = before[c], after[c], of_before[c], of_after[c]
        known = max(u, v) < KNOWN
        surer = a if u < v else b
        turn = bend * (b - a)
        both = QUARTER * (u + v) + turn * turn
        # A wall ends within the pixel that shows it.
        little = min(min(u, v), WALL) + LONELY + surer * surer
        alone = both if both == np.inf else little
        step[c] = (HALF * (a + b) + more[c] if known else surer) * size
        spread[c] = ((both if known else alone) + floor * floor) * size * size


@compiled
def stiffen(
    height: F4,
    wants_right: F4,
    wants_down: F4,
    of_right: F4,
    of_down: F4,
    unit: np.float32,
    square: np.float32,
    right: F4,
    down: F4,
) -> None:
    """Enter the stiffness of steps, from their variances and the height's departure from them."""
    rows = len(height)
    for row in range(rows):
        here = height[row]
        _weigh(here, here[1:], wants_right[row], of_right[row], unit, square, right[row])
        if row + 1 < rows:
            there = height[row + 1]
            _weigh(here, there, wants_down[row], of_down[row], unit, square, down[row])


@compiled
def _weigh(
    here: F4,
    there: F4,
    wants: F4,
    variance: F4,
    unit: np.float32,
    square: np.float32,
    stiffness: F4,
) -> None:
    for c in range(stiffness.size):
        residual = there[c] - here[c] - wants[c]
        stiffness[c] = unit / (variance[c] + residual * residual / square)
