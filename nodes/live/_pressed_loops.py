"""The loops of `_simulated_sensor` over the pixels around its ball, compiled by numba.

Compiled, they leave a core to the reconstruction, which a simulated camera would otherwise slow
down.  Importing numba takes half a second, so a sensor imports this module when it is created.
"""

from __future__ import annotations

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes._compiled import compiled

LEAST, ZERO, ONE = np.float32(1e-6), np.float32(0), np.float32(1)


@compiled
def surface_around(
    across: F4, down: F4, heights: F4, steepness: F4, by: np.float32
) -> tuple[F4, F4, F4]:
    """Height in mm and slopes p and q at offsets from the ball's axis, W and H.

    `heights` and `steepness` are tabulated by distance from the axis, with `by` entries per mm.
    """
    size = down.size, across.size
    height, p, q = (
        np.empty(size, np.float32),
        np.empty(size, np.float32),
        np.empty(size, np.float32),
    )
    last = heights.size - 1
    for i in range(down.size):
        for j in range(across.size):
            distance = np.sqrt(across[j] * across[j] + down[i] * down[i])
            cell = distance * by
            index = min(int(cell), last - 1)
            share = np.float32(min(cell - np.float32(index), ONE))
            height[i, j] = heights[index] + share * (heights[index + 1] - heights[index])
            rise = steepness[index] + share * (steepness[index + 1] - steepness[index])
            rise = ZERO if cell > last else rise / np.maximum(distance, LEAST)
            p[i, j], q[i, j] = rise * across[j], rise * down[i]
    return height, p, q


@compiled
def light_around(
    x: F4, y: F4, led: F4, height: F4, p: F4, q: F4, flat: F4, bright: F4, strength: np.float32
) -> F4:
    """Light of an LED (equation N1): `flat` is that of the film at rest, x, y and `led` in mm."""
    light = np.empty(height.shape, np.float32)
    lx, ly, lz = led[0], led[1], led[2]
    for i in range(y.size):
        dy = ly - y[i]
        z, along, aside, rest, bare, made = height[i], p[i], q[i], flat[i], bright[i], light[i]
        for j in range(x.size):
            dx, dz = lx - x[j], lz - z[j]
            plan = dx * dx + dy * dy
            nearer = (plan + lz * lz) / (plan + dz * dz)
            gain = nearer * np.sqrt(nearer) / lz
            slope = np.sqrt(ONE + along[j] * along[j] + aside[j] * aside[j])
            cosine = gain * (dz - along[j] * dx - aside[j] * dy) / slope
            lit = cosine if cosine > ZERO else ZERO
            made[j] = rest[j] * bare[j] * strength * lit
    return light
