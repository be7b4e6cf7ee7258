"""Errors at edges that no pixel resolves.

``kernels/error/height_error.cl`` computes the same (deviation).
"""

import math

import cv2
import numpy as np

from tactograph.nodes import F4, Height
from tactograph.nodes.optics.difference import second_differences
from tactograph.nodes.slope.pixel_mean_slope import PIXEL_VARIANCE

RESOLVED_BEND = np.float32(0.5)
"""Largest difference of slopes from pixel to pixel at which an edge is resolved."""


def edge_deviation_px(blur: float) -> np.float32:
    """Return the standard deviation in px of the place of an unresolved edge.

    It may lie anywhere in the pixel (variance 1/12), and as far away as the blur spreads it.
    """
    return np.float32(math.sqrt(PIXEL_VARIANCE + blur * blur))


def largest_bend(height: Height) -> F4:
    """Return sqrt(z_xx^2 + z_yy^2) of the height's second differences, the largest of 3 x 3 px."""
    return np.asarray(cv2.dilate(np.hypot(*second_differences(height)), np.ones((3, 3), np.uint8)))
