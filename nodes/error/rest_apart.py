"""Find how far apart the pieces of film at rest lie that a touch separates."""

import cv2
import numpy as np

from tactograph.graph import node, warn
from tactograph.nodes import Height, Mask
from tactograph.nodes.light.rest_mask import pieces_apart


@node
def rest_apart(rest: Mask, free: Height) -> Height:
    """Return how far each pixel may be off because its film at rest is not at zero.

    All film at rest is held at zero.  But a touch whose calm top reaches the border of the frame
    looks like film at rest, too, and light does not distinguish the two.  Each piece counts as far
    as `pieces_apart` measures.  Film between pieces takes the mean of their distances, weighted by
    its inverse distance to each.  A warning is given if a piece is nearer to the top of the touch
    than to the film.

    Parameters
    ----------
    rest : H x W, 1 on the film at rest
    free : H x W in mm, a height for which no film was held at zero

    Returns
    -------
    H x W in mm; 0 on the piece that holds most of the border, and everywhere if there is no other.
    """
    pieces, beyond = pieces_apart(rest, free)
    highest = np.abs(beyond).max()
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
    for piece in range(1, beyond.size):
        away = cv2.distanceTransform((pieces != piece).astype(np.uint8), cv2.DIST_L2, 5)
        weight = 1 / np.maximum(away, 1)
        total += weight
        hanging += beyond[piece] * weight
    return np.where(rest != 0, beyond[pieces], hanging / total).astype(np.float32)
