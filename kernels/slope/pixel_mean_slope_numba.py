"""Slopes corrected for the change of the normal within a pixel: ``pixel_mean_slope.cl`` for the
host, a row after the other, so that each normal is found once.
"""

from __future__ import annotations

import numpy as np

from tactograph.graph.backends.numba import inlined

F4 = np.float32
HALF, ONE, TWELFTH = F4(0.5), F4(1), F4(1 / 12)


def pixel_mean_slope(slope, out, most, first, last):
    _, H, W = slope.shape
    # The normals of three rows; the first and the last pixel of each once more beside it.
    normals = np.empty((3, 3, W + 2), F4)
    share = np.full(W, HALF)
    share[0] = share[W - 1] = ONE
    for row in range(max(first - 1, 0), min(first + 1, H)):
        enter_normals(slope[:, row], normals[row % 3])
    for row in range(first, last):
        above, below = max(row - 1, 0), min(row + 1, H - 1)
        if below > row:
            enter_normals(slope[:, below], normals[below % 3])
        correct(
            slope[:, row], normals[row % 3], normals[above % 3], normals[below % 3],
            HALF if below - above == 2 else ONE, share, most, out[:, row],
        )  # fmt: skip


@inlined
def enter_normals(slope, normals):
    W = slope.shape[1]
    for i in range(W):
        p, q = slope[0, i], slope[1, i]
        nz = ONE / np.sqrt(ONE + p * p + q * q)
        normals[0, i + 1], normals[1, i + 1], normals[2, i + 1] = -p * nz, -q * nz, nz
    for axis in range(3):
        normals[axis, 0], normals[axis, W + 1] = normals[axis, 1], normals[axis, W]


@inlined
def correct(slope, here, above, below, upright, share, most, out):
    for i in range(slope.shape[1]):
        p, q = slope[0, i], slope[1, i]
        down = (
            (below[0, i + 1] - above[0, i + 1]) * upright,
            (below[1, i + 1] - above[1, i + 1]) * upright,
            (below[2, i + 1] - above[2, i + 1]) * upright,
        )
        along = (
            (here[0, i + 2] - here[0, i]) * share[i],
            (here[1, i + 2] - here[1, i]) * share[i],
            (here[2, i + 2] - here[2, i]) * share[i],
        )
        add_p = down[2] * (down[0] + p * down[2]) + along[2] * (along[0] + p * along[2])
        add_q = down[2] * (down[1] + q * down[2]) + along[2] * (along[1] + q * along[2])
        square = ONE + p * p + q * q
        limit, by = most * square, square * TWELFTH
        out[0, i] = p + within(add_p * by, limit)
        out[1, i] = q + within(add_q * by, limit)


@inlined
def within(value, limit):
    low = value if value > -limit else -limit
    return low if low < limit else limit
