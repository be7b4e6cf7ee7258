"""Find how far the images of a touch lie apart, as when film creeps from flash to flash (T7)."""

from typing import Annotated

import numpy as np

from tactograph.graph import Port, node
from tactograph.nodes import F4, CoarseLight, Height, Labels, LightPositions, PixelSize
from tactograph.nodes.optics.near_light import places, vectors_at
from tactograph.nodes.trust.checked_cells import MIN_CELLS, MIN_LEDS
from tactograph.nodes.trust.explained import explained

MAX_CELLS_OF_SHIFT = 250
"""Cells that suffice for two unknowns of each LED, of those whose light changes more than usual."""
EVEN_STEPS = 1e-6
"""Difference, by rounding, of steps from flash to flash that count as equal."""
ImageShifts = Annotated[F4, Port("K 2", "1", low=-0.02, high=0.02)]
"""How far each LED's image lies from the place of all along x and y, as shares of the width; 0: all
show film at one place."""


def creep_and_shift(shifts: ImageShifts) -> tuple[float, float]:
    """Return how far images lie apart, as a share of the width: of film that creeps, and else.

    Film creeps that moves as far from each flash to the next.  Single images may look shifted on
    valid touches, where light changes at the edge of a contact.
    """
    apart = float(np.linalg.norm(shifts[:, None] - shifts, axis=2).max())
    is_even = np.allclose(np.diff(shifts, 2, axis=0), 0, atol=EVEN_STEPS)
    return (apart, 0.0) if is_even else (0.0, apart)


@node
def image_shifts(
    light: CoarseLight, used: Labels, height: Height, lights: LightPositions, pixel: PixelSize
) -> ImageShifts:
    """Return how far each LED's image is from the place of all, where LEDs flash in turn (T7).

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

    Returns
    -------
    K x 2; 0 of three lights, of too few cells, and where the light shows no shifts.
    """
    count, rows, columns = light.shape
    by_shift = np.asarray(np.gradient(light, axis=(2, 1))) * columns
    usable = used == (1 << count) - 1
    change = np.where(usable, np.square(by_shift).sum(axis=(0, 1)), 0).ravel()
    sharp = np.flatnonzero(change > change.mean())
    if count <= MIN_LEDS or sharp.size < MIN_CELLS:
        return np.zeros((count, 2), np.float32)
    y, x = np.divmod(sharp[:: -(-sharp.size // MAX_CELLS_OF_SHIFT)], columns)
    where = places(columns, np.float32(pixel))[x], places(rows, np.float32(pixel))[y], height[y, x]
    v = vectors_at(lights, *where).transpose(2, 0, 1)
    square = v.transpose(0, 2, 1) @ v
    project = np.eye(count, dtype=np.float32) - v @ np.linalg.inv(square) @ v.transpose(0, 2, 1)
    residual = np.einsum("njk,kn->jn", project, light[:, y, x])
    causes = np.einsum("njk,akn->kajn", project, by_shift[:, :, y, x])
    shifts = explained(residual, causes.reshape(2 * count, count, -1)).reshape(count, 2)
    if shifts.any():
        order = np.arange(count) - (count - 1) / 2
        creep = np.outer(order, explained(residual, np.tensordot(order, causes, 1)))
        shifts = creep if creep.any() else shifts - shifts.mean(axis=0)
    return np.asarray(shifts, np.float32)
