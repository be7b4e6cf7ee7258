"""The loop of `_sweep` over steps and cells, compiled by numba.

It processes a row of cells at a time: first the test for what rises, in a loop that LLVM
vectorises, then the few cells that see something rise.  Operations and their order are those of
one cell after another, so sums do not depend on it.

Importing numba takes half a second, so `_sweep` imports this where the host sweeps, not above.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes._compiled import compiled

if TYPE_CHECKING:
    from tactograph.nodes.light._sweep import Looking, Numbers, Steps

ZERO, HALF, ONE, TWO = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2)


@compiled
def rise(
    on: Looking,
    steps: Steps,
    rises: F4,
    rim: int,
    by: np.float32,
    share: F4,
    direction: F4,
    here: Numbers,
    there: Numbers,
) -> int:
    """Enter what rises over the horizons, as a `Sight`, and raise them; return the number of pairs.

    `rises` is the film's height, with `rim` cells more on all sides than the frame.  `by` is 1 over
    the height of the camera's pupil.
    """
    columns = on.seen.shape[1]
    higher, heights = np.empty(columns, np.uint8), np.empty(columns, np.float32)
    pairs = 0
    for number in range(steps.length.size):
        step, part = np.float32(steps.length[number]), steps.part[number]
        below, right = steps.below[number] + rim, steps.right[number] + rim
        down, aside = steps.middle[number, 0] + rim, steps.middle[number, 1] + rim
        first, last = steps.columns[number, 0], steps.columns[number, 1]
        for row in range(steps.rows[number, 0], steps.rows[number, 1]):
            one = rises[row + below[0], first + right[0] : last + right[0]]
            other = rises[row + below[1], first + right[1] : last + right[1]]
            seen, steepest = on.seen[row, first:last], on.steepest[row, first:last]
            longest = steps.longest[row, first:last]
            for i in range(one.size):
                ends = longest[i] < step
                z = ZERO if ends else one[i] + part * (other[i] - one[i])
                far = min(longest[i], step) * steps.width
                heights[i] = z
                rising = z / (ONE - by * z) - seen[i] > steepest[i] * far
                higher[i] = rising and (steps.beyond or not ends)
            for i in range(one.size):
                if higher[i]:
                    column, far = first + i, min(longest[i], step) * steps.width
                    found = _raised(on, steps, (row, column), far, heights[i], by)
                    share[pairs] = found[0]
                    direction[0, pairs], direction[1, pairs], direction[2, pairs] = found[1:]
                    here[pairs] = row * columns + column
                    there[pairs] = (row + down) * rises.shape[1] + column + aside
                    pairs += 1
    return pairs


@compiled
def _raised(
    on: Looking, steps: Steps, cell: tuple[int, int], far: np.float32, z: np.float32, by: np.float32
) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Raise the horizon of a cell to film `z` high, `far` mm along the longer side of a step.

    Returns its share of the light that arrives, and the direction of its middle.
    """
    row, column = cell
    on.steepest[cell] = (z / (ONE - by * z) - on.seen[cell]) / far
    px, py, pz = on.at[0, row, column], on.at[1, row, column], on.at[2, row, column]
    ex, ey, ez = on.eye[0, row, column], on.eye[1, row, column], on.eye[2, row, column]
    # From where the camera's ray of P meets the film at rest.
    whole, nearer = ONE - by * pz, ONE - by * z
    x = (px / whole + steps.across * far) * nearer - px
    y = (py / whole + steps.down * far) * nearer - py
    z = z - pz
    up = x * ex + y * ey + z * ez
    aside = np.sqrt(x * x + y * y + z * z - up * up)
    t = up / aside
    half = (t + on.horizon[cell]) / TWO
    part = t / (ONE + t * t)
    higher = HALF * on.forwards[cell] * (np.arctan(t) + part) + HALF * on.facing[cell] * t * part
    share = on.gain[cell] * (higher - on.below[cell])
    on.horizon[cell], on.below[cell] = t, higher
    size = np.sqrt(ONE + half * half)
    return (
        share,
        ((x - up * ex) / aside + half * ex) / size,
        ((y - up * ey) / aside + half * ey) / size,
        ((z - up * ez) / aside + half * ez) / size,
    )
