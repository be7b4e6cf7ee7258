"""Tell where an object of known shape says something about the LEDs."""

import numpy as np

from tactograph.sdk import Mask, Slope, node

MIN_SLOPE = 0.05
"""Under any LED above the film, light on a gentler slope is within the few per cent that a right
shape may depart by: it would hide what a wrong one departs by."""


@node
def sloped_film(slope: Slope, mask: Mask) -> Mask:
    """Return the known pixels that slope.

    Parameters
    ----------
    slope : 2 x H x W
    mask : H x W, 1 where the slope is known
    """
    return np.asarray(mask * (np.hypot(*slope) > MIN_SLOPE), np.uint8)
