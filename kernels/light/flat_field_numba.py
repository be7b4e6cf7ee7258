"""Light relative to the film at rest, per LED, for the host: see ``flat_field.cl``."""

from __future__ import annotations

import numpy as np

from tactograph.graph.backends.numba import inlined

F4 = np.float32
HALF, TWO = F4(0.5), F4(2)
DARKEST = F4(0.02)


def flat_field(image, flat, dark, drift, out, floor, first, last):
    K, H, W = image.shape
    side = TWO / F4(W)
    for k in range(K):
        for row in range(first, last):
            v = (F4(row) - HALF * F4(H - 1)) * side
            for column in range(W):
                rest = larger(floor, flat[k, row, column])
                if drift.size:
                    u = (F4(column) - HALF * F4(W - 1)) * side
                    rest *= larger(DARKEST, gain_at(drift[k], u, v))
                out[k, row, column] = (image[k, row, column] - dark[row, column]) / rest


@inlined
def gain_at(c, u, v):
    """The polynomial of a drift, see `film_drift`."""
    return c[0] + c[1] * u + c[2] * v + c[3] * u * u + c[4] * u * v + c[5] * v * v


@inlined
def larger(low, value):
    return low if low > value else value
