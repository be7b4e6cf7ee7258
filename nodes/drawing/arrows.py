"""Draw the shifts of markers as arrows."""

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, U1

VISIBLE_RGB, PREDICTED_RGB = (255, 176, 0), (154, 154, 154)
"""Colours (red, green, blue) of visible markers, and of predicted ones."""
SUBPIXEL_BITS = 4
"""OpenCV draws in sixteenths of a pixel."""


def draw_arrows(
    picture: NDArray[np.uint8], place: F4, shift: F4, is_tracked: U1, scale: float
) -> NDArray[np.uint8]:
    """Draw an arrow from each marker's place at rest to its present place.

    Parameters
    ----------
    picture : H x W x 3 of 8 bit, red first; modified and returned
    place, shift, is_tracked : M x 2 and M x 2 in px of the image, and M
    scale : pixels of the picture per pixel of the image
    """
    unit = scale * (1 << SUBPIXEL_BITS)
    for begin, by, visible in zip(place, shift, is_tracked, strict=True):
        start, end = (
            (int(x), int(y))
            for x, y in np.round(
                ((begin + 0.5) + np.stack([0 * by, by])) * unit - (1 << SUBPIXEL_BITS) / 2
            )
        )
        colour = VISIBLE_RGB if visible else PREDICTED_RGB
        cv2.circle(picture, start, 1 << SUBPIXEL_BITS, colour, -1, cv2.LINE_AA, SUBPIXEL_BITS)
        cv2.arrowedLine(picture, start, end, colour, 1, cv2.LINE_AA, SUBPIXEL_BITS, 0.3)
    return picture
