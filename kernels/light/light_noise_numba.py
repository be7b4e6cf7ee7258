"""How uncertain each light is, for the host: see ``light_noise.cl``."""

from __future__ import annotations

import numpy as np

from tactograph.graph.backends.numba import inlined

ZERO = np.float32(0)


def light_noise(image, flat, noise, out, floor, first, last):
    K, _, W = image.shape
    shot, read = noise[0], noise[1]
    for k in range(K):
        for row in range(first, last):
            for column in range(W):
                variance = shot * larger(ZERO, image[k, row, column]) + read
                out[k, row, column] = np.sqrt(variance) / larger(floor, flat[k, row, column])


@inlined
def larger(low, value):
    return low if low > value else value
