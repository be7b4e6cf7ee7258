"""Remove single wrong pixels from images by a median."""

from typing import Literal

import cv2
import numpy as np

from tactograph.sdk import Light, node


@node(neutral="light")
def median_blur(light: Light, *, size: Literal[3, 5] = 3) -> Light:
    """Return the median of the pixels around each pixel, each LED separately.

    OpenCV's `medianBlur`.  It removes a hot pixel, or a speck of dust smaller than half the
    window; a straight edge stays where it is.

    Parameters
    ----------
    light : K x H x W; beyond the frame the border repeats (OpenCV's ``BORDER_REPLICATE``)
    size : side of the window in pixels
    """
    return np.asarray([cv2.medianBlur(plane, size) for plane in light], np.float32)


median_blur.opencl(grid="K H W", lanes="rows")
