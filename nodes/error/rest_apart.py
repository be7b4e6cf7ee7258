"""Find how far apart the pieces of film at rest lie that a touch separates."""

import cv2
import numpy as np
from scipy import ndimage

from tactograph.graph import node, warn
from tactograph.nodes import Height, Mask


@node
def rest_apart(rest: Mask, free: Height) -> Height:
    """Return how far each pixel may be off because its film at rest is not at zero.

    All film at rest is held at zero.  But a touch whose calm top reaches the border of the frame
    looks like film at rest, too, and light does not distinguish the two.  Within a piece, errors of
    the slopes alone make the free height depart from its mean.  The distance between the means of
    two pieces counts as far as it exceeds both departures.  Film between pieces takes the mean of
    their distances, weighted by its inverse distance to each.  A warning is given if a piece is
    nearer to the top of the touch than to the film.

    Parameters
    ----------
    rest : H x W, 1 on the film at rest
    free : H x W in mm, a height for which no film was held at zero

    Returns
    -------
    H x W in mm; 0 on the largest piece, and everywhere if there is only one piece.
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
            f"by its slopes, one part of the film at rest lies {highest:.2g} mm above or below "
            "another, and both are held at zero: a touch may reach the frame's border (the stated "
            "error includes that)"
        )
    if not beyond.any():
        return np.zeros_like(free)
    # A plane for each piece would not fit into memory if film at rest consists of many specks.
    total, hanging = np.zeros(rest.shape), np.zeros(rest.shape)
    for piece in range(1, count):
        away = cv2.distanceTransform((pieces != piece).astype(np.uint8), cv2.DIST_L2, 5)
        weight = 1 / np.maximum(away, 1)
        total += weight
        hanging += beyond[piece] * weight
    return np.where(rest != 0, beyond[pieces], hanging / total).astype(np.float32)
