"""The errors of edges that no pixel resolves.

``kernels/error/height_error.cl`` holds the same (deviation).
"""

import math

import cv2
import numpy as np

from tactograph.nodes import F4, Height
from tactograph.nodes.optics.difference import second_differences
from tactograph.nodes.slope.pixel_mean_slope import PIXEL_VARIANCE

RESOLVED_BEND = np.float32(0.5)
"""Difference of slopes from pixel to pixel up to which an edge is resolved."""


def edge_deviation_px(blur: float) -> np.float32:
    """Return the standard deviation in px of the place of an edge that a pixel does not resolve.

    It may lie anywhere in the pixel, and as far away as the blur spreads it.
    """
    return np.float32(math.sqrt(PIXEL_VARIANCE + blur * blur))


def largest_bend(height: Height) -> F4:
    """Return the largest root of squares of the height's second differences, of 3 x 3 pixels."""
    return np.asarray(cv2.dilate(np.hypot(*second_differences(height)), np.ones((3, 3), np.uint8)))
