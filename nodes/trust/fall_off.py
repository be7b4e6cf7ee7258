"""How light at the border of the film at rest changes with a motion of the camera."""

from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.graph import Port, node
from tactograph.nodes import F4, CoarseLight
from tactograph.nodes.trust.checked_cells import MIN_LIGHT

RING_CELLS = 4
"""Width of the border at which film should be at rest, and (as two standard deviations) of the
Gaussian by which the fall-off of the light is smoothed."""
FallOff = Annotated[F4, Port("4 K h w", "1")]
"""Derivative of the logarithm of the light at the border by a shift along x and y, a zoom and a
turn; 0 elsewhere."""


@node
def fall_off(flat: CoarseLight) -> FallOff:
    """Return how the light along the border changes with a motion of the camera (T7).

    If film that was at r + v is seen at r, log I_k(r) = log F_k(r) + v . grad log F_k(r) + g_k,
    with g_k the gain of LED k (optical flow: B. Horn and B. Schunck, "Determining optical flow",
    1981).  The motion v is a shift, a zoom and a turn about the middle, the same under all LEDs;
    each LED falls off in a different direction.

    Parameters
    ----------
    flat : K x h x w, the film at rest on cells

    Returns
    -------
    4 x K x h x w, of mean 0 along the border of each LED; lengths are shares of the image's width.
    """
    count, rows, columns = flat.shape
    ring = border_cells((rows, columns), RING_CELLS)
    # Neighbouring cells are redundant, and these suffice for four unknowns.
    ring &= np.indices(ring.shape).sum(axis=0) % RING_CELLS == 0
    middle = np.array([rows - 1, columns - 1])[:, None, None] / 2
    y, x = (np.mgrid[:rows, :columns] - middle)[:, ring] / columns
    smooth = [
        cv2.GaussianBlur(np.log(np.maximum(plane, MIN_LIGHT)), (0, 0), RING_CELLS / 2)
        for plane in flat
    ]
    down, along = (columns * slope[:, ring] for slope in np.gradient(np.stack(smooth), axis=(1, 2)))
    changes = np.stack([along, down, x * along + y * down, x * down - y * along])
    out = np.zeros((len(changes), count, rows, columns), np.float32)
    out[:, :, ring] = changes - changes.mean(axis=2, keepdims=True)
    return out


def border_cells(shape: tuple[int, ...], width: int) -> NDArray[np.bool_]:
    """Return the cells of h x w within `width` of the border, at which film should be at rest."""
    border = np.ones(shape, bool)
    border[width:-width, width:-width] = False
    return border
