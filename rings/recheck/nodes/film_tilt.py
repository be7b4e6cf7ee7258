"""Predict how the light of the film at rest responds to a tilt, by the film's model."""

from typing import cast

import numpy as np

from tactograph.rings.recheck.nodes import TiltResponse
from tactograph.sdk import F4, Film, Light, PixelSize, node
from tactograph.sdk.unstable import places, predict

SLOPE_STEP = 0.02
"""Step of the slope for the central differences."""


@node
def film_tilt(flat: Light, film: Film, pixel: PixelSize) -> TiltResponse:
    """Return the derivative of each LED's light with respect to slope, on the film at rest.

    From equation F1 (`optics/film`), by central differences at height 0.

    Parameters
    ----------
    flat : K x H x W; only its size is used
    film : the LEDs' places in mm and the film's properties
    pixel : mm per px
    """
    _, rows, columns = flat.shape
    across, down = places(columns, np.float32(pixel)), places(rows, np.float32(pixel))
    x, y = (part.ravel().astype(np.float64) for part in np.meshgrid(across, down))
    level = np.zeros_like(x)
    by = []
    for slope in np.eye(2) * SLOPE_STEP:
        more, less = (_normal(sign * slope, x.size) for sign in (1, -1))
        change = predict(film, more, x, y, level) - predict(film, less, x, y, level)
        by.append(change.reshape(-1, rows, columns) / (2 * SLOPE_STEP))
    return cast(F4, np.stack(by, axis=1).astype(np.float32))


def _normal(slope: np.ndarray, count: int) -> np.ndarray:
    p, q = slope
    upright = np.array([-p, -q, 1.0]) / np.sqrt(1 + p * p + q * q)
    return np.repeat(upright[:, None], count, axis=1)
