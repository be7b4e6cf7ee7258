"""Levels of heights as colour pictures of 8 bits, for formats that know no depth."""

import numpy as np
from numpy.typing import NDArray

from tactograph.rings.export.height_levels import Levels


def levels_picture(levels: Levels) -> NDArray[np.uint8]:
    """Return H x W x 3: the high byte of every level as red, the low byte as green."""
    high, low = (levels >> 8).astype(np.uint8), (levels & 255).astype(np.uint8)
    return np.stack([high, low, np.zeros_like(low)], axis=-1)


def picture_levels(picture: NDArray[np.uint8]) -> Levels:
    """Return the levels of such a picture."""
    high, low = picture[..., 0].astype(np.uint16), picture[..., 1]
    return high << np.uint16(8) | low
