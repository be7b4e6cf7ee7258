"""Find how far the images of a touch lie apart, as when film creeps from flash to flash (T7)."""

import numpy as np

from tactograph.nodes import F8, CoarseLight, Height, Labels, LightPositions
from tactograph.nodes.optics.near_light import places, vectors_at
from tactograph.nodes.trust.checked_cells import MIN_CELLS, MIN_LEDS
from tactograph.nodes.trust.explained import explained

MAX_CELLS_OF_SHIFT = 250
"""Cells that suffice for two unknowns of each LED, of those whose light changes more than usual."""


def image_shifts(
    light: CoarseLight, used: Labels, height: Height, lights: LightPositions, pixel: float
) -> F8:
    """Return how far each LED's image is from the place of all, K x 2, as shares of the width.

    Four lights or more agree on no normal if each shows the film at another place.  If image k
    shows at r what should be seen at r + d_k, v is that of equation N1, and P = 1 - v (v'v)^-1 v'
    takes away what any normal explains, then the light m leaves P m = P sum_k e_k (d_k . grad m_k).

    All d_k are 0 if they explain too little of it (`explained`).  On gentle slopes some look alike,
    and the smallest are found.  So film that creeps, as far from each flash to the next, is taken
    where it explains as much.

    Parameters
    ----------
    light : K x h x w on cells, as of a matt film
    used : h x w, the LEDs that reach a cell; only cells that all LEDs reach count
    height, lights, pixel : h x w in mm, K x 3 in mm, mm per cell
    """
    count, rows, columns = light.shape
    by_shift = np.asarray(np.gradient(light, axis=(2, 1))) * columns
    usable = used == (1 << count) - 1
    change = np.where(usable, np.square(by_shift).sum(axis=(0, 1)), 0).ravel()
    sharp = np.flatnonzero(change > change.mean())
    if count <= MIN_LEDS or sharp.size < MIN_CELLS:
        return np.zeros((count, 2))
    y, x = np.divmod(sharp[:: -(-sharp.size // MAX_CELLS_OF_SHIFT)], columns)
    where = places(columns, np.float32(pixel))[x], places(rows, np.float32(pixel))[y], height[y, x]
    v = vectors_at(lights, *where).transpose(2, 0, 1)
    square = v.transpose(0, 2, 1) @ v
    left = np.eye(count, dtype=np.float32) - v @ np.linalg.inv(square) @ v.transpose(0, 2, 1)
    residual = np.einsum("njk,kn->jn", left, light[:, y, x])
    causes = np.einsum("njk,akn->kajn", left, by_shift[:, :, y, x])
    shifts = explained(residual, causes.reshape(2 * count, count, -1)).reshape(count, 2)
    if not shifts.any():
        return shifts
    order = np.arange(count) - (count - 1) / 2
    creep = np.outer(order, explained(residual, np.tensordot(order, causes, 1)))
    return np.asarray(creep if creep.any() else shifts - shifts.mean(axis=0))
