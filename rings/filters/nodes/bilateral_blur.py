"""Blur images, but not across edges."""

from typing import Annotated

import cv2
import numpy as np
from annotated_types import Interval

from tactograph.rings.filters.nodes._border import BORDER_TYPES, Border
from tactograph.sdk import Close, Light, node


@node(
    neutral="light",
    tolerance=Close(1e-4, why="OpenCV reads the weight of a difference from a table"),
)
def bilateral_blur(
    light: Light,
    *,
    radius: Annotated[int, Interval(ge=1, le=15)] = 3,
    sigma_light: Annotated[float, Interval(ge=0.02, le=1)] = 0.1,
    sigma_px: Annotated[float, Interval(gt=0, le=20)] = 1.5,
    border: Border = "replicate",
) -> Light:
    """Return the images blurred among pixels of similar light, each LED separately.

    OpenCV's `bilateralFilter` (C. Tomasi and R. Manduchi, "Bilateral filtering for gray and
    color images", ICCV 1998): the weight of a pixel falls with its distance and with the
    difference of its light, by a Gaussian each.

    Parameters
    ----------
    light : K x H x W, of full scale, or 1 on the film at rest
    radius : radius of the disk of pixels that count, in pixels
    sigma_light : standard deviation over light; much larger steps are preserved
    sigma_px : standard deviation over distance in pixels
    border : pixels beyond the frame, see `gaussian_blur`
    """
    side, rule = 2 * radius + 1, BORDER_TYPES[border]
    blurred = [
        cv2.bilateralFilter(plane, side, sigma_light, sigma_px, borderType=rule) for plane in light
    ]
    return np.asarray(blurred, np.float32)


bilateral_blur.opencl(grid="K H W", lanes="rows")
