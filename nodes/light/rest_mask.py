"""Find the film at rest: calm film that is connected to the border of the frame."""

from typing import Annotated

import cv2
import numpy as np
from annotated_types import Interval

from tactograph.graph import node
from tactograph.nodes import Mask, PixelSize

FLOODED_VALUE = 2


@node
def rest_mask(
    calm: Mask, pixel: PixelSize, *, margin_mm: Annotated[float, Interval(ge=0, le=10)] = 1.2
) -> Mask:
    """Mark the film whose height is zero.

    A flat top looks as calm as the film at rest, but it is not connected to the border of the
    frame.  A closing first fills single noisy pixels.  The mask then keeps a distance of
    `margin_mm` from everything else.

    Parameters
    ----------
    calm : H x W, from `calm_film`
    pixel : mm per px
    margin_mm
        Distance from the touch.  Film that returns to rest like exp(-d / reach) looks calm long
        before it is at rest.  Holding it at zero there would make the whole touch too low.

    Returns
    -------
    H x W, 1 on the film at rest.
    """
    closed = cv2.morphologyEx(calm, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    # A flood fill from a ring around the frame reaches all calm film connected to the border.
    ringed = cv2.copyMakeBorder(closed, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=1)
    cv2.floodFill(ringed, None, (0, 0), FLOODED_VALUE, flags=4)
    joined = (ringed[1:-1, 1:-1] == FLOODED_VALUE).astype(np.uint8)
    margin = min(round(margin_mm / pixel), max(calm.shape))
    square = np.ones((2 * margin + 1, 2 * margin + 1), np.uint8)
    return np.asarray(cv2.erode(joined, square, borderValue=1), np.uint8)
