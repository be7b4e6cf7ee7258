"""Resample images to a regular grid on the film, as a camera without distortion sees it."""

import numpy as np

from tactograph.graph import Close, node
from tactograph.nodes import Lens, Light
from tactograph.nodes.optics.bicubic import between_pixels
from tactograph.nodes.optics.lens import camera_places, is_straight


@node(
    neutral="image",
    tolerance=Close(1e-4, why="places are rounded to 1e-5 px, times a step between two pixels"),
)
def undistort(image: Light, lens: Lens) -> Light:
    """Return the images on the ideal grid: square pixels of equal size on the film at rest.

    The middle of the image stays in place.  Values between pixels are interpolated by cubic
    convolution (`bicubic`).  Ideal pixels that the camera does not see, at the border of an
    image with pincushion distortion, repeat the nearest pixel that it sees.  Without a lens the
    images are returned unchanged, bit for bit.

    Parameters
    ----------
    image : K x H x W, as captured
    lens : length 8, from `read_lens` (equations L1 and L2)
    """
    if is_straight(lens):
        return image
    x, y = camera_places(lens, image.shape[1:])
    return np.stack([between_pixels(plane, x, y) for plane in image])


undistort.opencl(grid="H W", lanes="rows", integers="image")
undistort.idle(is_straight)
