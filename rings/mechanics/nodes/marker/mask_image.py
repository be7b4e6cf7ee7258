"""Keep the part of images that a mask shows."""

import cv2
import numpy as np

from tactograph.sdk import Light, Mask, node


@node(neutral="light")
def mask_image(light: Light, mask: Mask, *, outside: float = 1.0) -> Light:
    """Return the images where the mask is set, and one value elsewhere.

    OpenCV's `copyTo` with a mask.

    Parameters
    ----------
    light : K x H x W, of full scale, or 1 on the film at rest
    mask : H x W; any value but 0 keeps the pixel
    outside : the light elsewhere; 1 is the film at rest, once divided by the flat field
    """
    masked_light = np.full_like(light, outside)
    for plane, masked in zip(light, masked_light, strict=True):
        cv2.copyTo(plane, mask, masked)
    return masked_light


mask_image.opencl(grid="K H W")
