"""Mix two sets of images."""

from typing import Annotated

import cv2
import numpy as np
from annotated_types import Interval

from tactograph.sdk import Close, Light, node


@node(neutral="first", tolerance=Close(1e-6, 1e-6, why="two products and a sum, fused or not"))
def blend_images(
    first: Light, second: Light, *, share: Annotated[float, Interval(ge=0, le=1)] = 0.5
) -> Light:
    """Return the weighted mean of two sets of images, LED by LED.

    OpenCV's `addWeighted` with the weights ``1 - share`` and ``share``.

    Parameters
    ----------
    first, second : K x H x W
    share : weight of the second; 0 gives the first
    """
    mixed = [
        cv2.addWeighted(one, 1 - share, other, share, 0)
        for one, other in zip(first, second, strict=True)
    ]
    return np.asarray(mixed, np.float32)


blend_images.opencl(grid="K H W")
