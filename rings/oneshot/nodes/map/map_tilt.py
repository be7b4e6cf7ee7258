"""Predict how the light of the film at rest responds to a tilt, by a reflectance map."""

import numpy as np

from tactograph.rings.oneshot.nodes.map.reflectance_map import ReflectanceMap, terms
from tactograph.rings.recheck.nodes import TiltResponse
from tactograph.sdk import Light, node

LINEAR_HARMONICS, MIXED_HARMONICS = [0, 1], [4, 5]
"""x and y, xz and yz: harmonics that change with a tilt of the film at rest, to first order."""


@node
def map_tilt(flat: Light, reflectance: ReflectanceMap) -> TiltResponse:
    """Return the derivative of each light with respect to slope, on the film at rest.

    From equation M1 (`reflectance_map`) with the normal (-p, -q, 1): -(c_x + c_xz) and
    -(c_y + c_yz).

    Parameters
    ----------
    flat : K x H x W; only its size is used
    reflectance : K x 9 x 15
    """
    rows, columns = flat.shape[1:]
    y, x = np.indices((rows, columns)).reshape(2, -1).astype(np.float64)
    place = terms(x, y, (rows, columns))
    by = reflectance[:, LINEAR_HARMONICS] + reflectance[:, MIXED_HARMONICS]
    return np.asarray(-(by @ place).reshape(*by.shape[:2], rows, columns), np.float32)
