"""The errors of edges that no pixel resolves, and of what a blur flattens.

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


def blurred(height: Height, pixel: float, blur: float = 0.0) -> F4:
    """Return the deviation of heights by a pixel's size and the camera's blur, in mm.

    An edge that no pixel resolves is out of place (`edge_deviation_px`), and what bends more gently
    is flattened: a Gaussian that spreads the light spreads the slopes and the height that follows
    from them, to first order by half its variance times the Laplacian.
    """
    across, along = second_differences(height)
    beyond = largest_bend(height) - RESOLVED_BEND * np.float32(pixel)
    edge = np.maximum(beyond, np.float32(0)) * edge_deviation_px(blur)
    flat = np.abs(np.float32(blur * blur / 2) * (across + along))
    return np.asarray(np.maximum(edge, flat), np.float32)


def largest_bend(height: Height) -> F4:
    """Return the largest root of squares of the height's second differences, of 3 x 3 pixels."""
    return np.asarray(cv2.dilate(np.hypot(*second_differences(height)), np.ones((3, 3), np.uint8)))
