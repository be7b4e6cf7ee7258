"""Find the film at rest: calm film that is connected to the border of the frame."""

from typing import Annotated

import cv2
import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.graph import node
from tactograph.nodes import F8, Height, Mask, PixelSize

FLOODED_VALUE = 2
REST_MARGIN_MM = 1.2
"""Distance of film at rest from a touch."""


@node
def rest_mask(
    calm: Mask,
    pixel: PixelSize,
    free: Height | None = None,
    *,
    margin_mm: Annotated[float, Interval(ge=0, le=10)] = REST_MARGIN_MM,
) -> Mask:
    """Mark the film whose height is zero.

    A flat top looks as calm as the film at rest, but it is not connected to the border of the
    frame.  A closing first fills single noisy pixels.  The mask then keeps a distance of
    `margin_mm` from everything else.  A flat top that reaches the border is left out if `free`
    shows it: it is nearer to the top of the touch than to most of the border.

    Parameters
    ----------
    calm : H x W, from `calm_film`
    pixel : mm per px
    free : H x W in mm, a height for which no film was held at zero
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
    rest = kept_apart(joined, margin_mm, pixel)
    if free is None:
        return rest
    pieces, apart = pieces_apart(rest, free)
    return np.where((2 * np.abs(apart) > np.ptp(free))[pieces], 0, rest).astype(np.uint8)


def kept_apart(film: Mask, margin_mm: float, pixel: PixelSize) -> Mask:
    """Return the film that keeps a distance of a margin from all else; H x W."""
    margin = min(round(margin_mm / pixel), max(film.shape))
    square = np.ones((2 * margin + 1, 2 * margin + 1), np.uint8)
    return np.asarray(cv2.erode(film, square, borderValue=1), np.uint8)


def pieces_apart(rest: Mask, free: Height) -> tuple[NDArray[np.int32], F8]:
    """Number the connected pieces of film at rest, and measure how far each lies from the first.

    Within a piece, errors of the slopes alone make the free height depart from its mean.  The
    distance between the means of two pieces counts as far as it exceeds both departures.

    Returns
    -------
    H x W, the number of the piece or 0, and the distance of each number from the piece that holds
    most of the frame's border, in mm.
    """
    count, labels = cv2.connectedComponents(rest, connectivity=4)
    pieces = np.asarray(labels, np.int32)
    if count <= 2:
        return pieces, np.zeros(count)
    area, sums = (np.bincount(pieces.ravel(), each, count) for each in (None, free.ravel()))
    mean = sums / np.maximum(area, 1)
    wander = np.zeros(count)
    np.maximum.at(wander, pieces.ravel(), np.abs(free - mean[pieces]).ravel())
    first = border_piece(pieces)
    apart, wander[0] = mean - mean[first], np.inf
    beyond = np.maximum(np.abs(apart) - wander - wander[first], 0)
    return pieces, np.asarray(np.sign(apart) * beyond)


def border_piece(pieces: NDArray[np.int32]) -> int:
    """Return the number of the piece that holds most of the frame's border; else the largest."""
    border = np.concatenate([pieces[0], pieces[-1], pieces[:, 0], pieces[:, -1]])
    return 1 + int(np.argmax(np.bincount(border if border.any() else pieces.ravel())[1:]))
