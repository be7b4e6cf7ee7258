"""How far apart film at rest lies in pieces that a touch parts."""

import cv2
import numpy as np
from scipy import ndimage

from tactograph.graph import node, warn
from tactograph.nodes import Height, Mask


@node
def rest_apart(rest: Mask, free: Height) -> Height:
    """Return how high film may lie with the film at rest that holds it, by slopes alone.

    All film at rest is held at zero.  A touch whose calm top reaches the border of the frame
    looks like film at rest, too, and the light does not tell which of both it is.  Each piece
    departs from its own mean by errors of the slopes alone; what lies between two means counts as
    far as it is more than both do.  A warning names a piece that is nearer to the top of the
    touch than to the film.  Film between pieces hangs on each of them by the inverse of its
    distance.

    Parameters
    ----------
    rest : H x W, 1 on the film at rest
    free : H x W in mm, a height for which no film was held at zero

    Returns
    -------
    H x W in mm; 0 on the largest piece, and where all film at rest lies together.
    """
    count, labels = cv2.connectedComponents(rest, connectivity=4)
    pieces = np.asarray(labels, np.int32)
    if count <= 2:
        return np.zeros_like(free)
    area, sums = (np.bincount(pieces.ravel(), each, count) for each in (None, free.ravel()))
    largest, mean = 1 + area[1:].argmax(), sums / np.maximum(area, 1)
    wander = ndimage.maximum(np.abs(free - mean[pieces]), pieces, np.arange(count))
    apart = mean - mean[largest]
    beyond = np.sign(apart) * np.maximum(np.abs(apart) - wander - wander[largest], 0)
    highest = np.abs(beyond[1:]).max()
    if 2 * highest > np.ptp(free):
        warn(
            f"film that looks at rest lies {highest:.2g} mm above or below other such film by its "
            "slopes, and is held at zero as well: a touch may reach the frame's border (the stated "
            "error counts that)"
        )
    if not beyond.any():
        return np.zeros_like(free)
    # One plane a piece would not fit into memory where film at rest is in a hundred specks.
    total, hanging = np.zeros(rest.shape), np.zeros(rest.shape)
    for piece in range(1, count):
        away = cv2.distanceTransform((pieces != piece).astype(np.uint8), cv2.DIST_L2, 5)
        weight = 1 / np.maximum(away, 1)
        total += weight
        hanging += beyond[piece] * weight
    return np.where(rest != 0, beyond[pieces], hanging / total).astype(np.float32)
