"""Predict how the light of the film at rest responds to a tilt, by the film's model."""

import numpy as np

from tactograph.rings.recheck.nodes import TiltResponse
from tactograph.sdk import Film, Light, PixelSize, node
from tactograph.sdk.nodes import film_light

SLOPE_STEP = 0.02
"""Step of the slope for the central differences."""


@node
def film_tilt(flat: Light, film: Film, pixel: PixelSize) -> TiltResponse:
    """Return the derivative of each LED's light with respect to slope, on the film at rest.

    By central differences of `film_light` at height 0.

    Parameters
    ----------
    flat : K x H x W; only its size is used
    film : the LEDs' places in mm and the film's properties
    pixel : mm per px
    """
    level = np.zeros(flat.shape[1:], np.float32)
    by = []
    for slope in np.eye(2, dtype=np.float32)[..., None, None] * np.float32(SLOPE_STEP):
        tilt = slope + np.zeros_like(level)
        more, less = (film_light(sign * tilt, level, film, pixel) for sign in (1, -1))
        by.append((more - less) / np.float32(2 * SLOPE_STEP))
    return np.stack(by, axis=1)
