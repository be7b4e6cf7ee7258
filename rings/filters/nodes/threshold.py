"""Find the pixels that are brighter than a threshold."""

from functools import reduce
from typing import Literal

import cv2
import numpy as np

from tactograph.sdk import Light, Mask, node


@node(neutral=1)
def threshold(light: Light, *, level: float = 0.5, lights: Literal["all", "any"] = "all") -> Mask:
    """Return H x W, 1 where the light exceeds the level, else 0.

    OpenCV's `threshold` (``THRESH_BINARY``) of each LED's image, and `bitwise_and` or
    `bitwise_or` of them.

    Parameters
    ----------
    light : K x H x W, of full scale, or 1 on the film at rest
    level : a pixel as bright as the level does not count
    lights : whether the light of all LEDs has to exceed the level, or that of any
    """
    join = cv2.bitwise_and if lights == "all" else cv2.bitwise_or
    masks = [cv2.threshold(plane, level, 1, cv2.THRESH_BINARY)[1] for plane in light]
    return reduce(join, [mask.astype(np.uint8) for mask in masks])


threshold.opencl(grid="H W")
