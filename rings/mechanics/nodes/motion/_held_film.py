"""Film that an object holds, as opposed to film that hangs beside it.

Raised film on which nothing presses curves up: the height of a membrane on springs is its reach
squared times its curvature.  So where film curves down an object holds it.
"""

import cv2
import numpy as np

from tactograph.sdk import F4, Contacts

CELLS_ACROSS = 160
"""Cells of a row on which curvature is looked at."""
SMOOTH_CELLS = 3.0
BRIDGE_CELLS = 10
"""Half of the widest valley that film bridges and still follows the object."""
LOW_SHARE = 0.1
"""Height, as a share of the highest, below which film is as good as free."""


def held_film(height: F4, contact: Contacts, margin_px: int) -> tuple[F4, float]:
    """Return heights of contacts without their rim, and of film that moves with the object.

    These are 2 x H x W, NaN elsewhere; `margin_px` is the rim's width.  The second is the first
    without what curves up from the outermost tops on to the film at rest.  The number returned
    is the share of the raised film that curves down: about 0.5 where film follows the object,
    and 0.2 where it hangs between few tops.
    """
    rim = np.ones((2 * margin_px + 1,) * 2, np.uint8)
    inside = cv2.erode((contact > 0).view(np.uint8), rim, borderValue=0)
    side = max(1, round(height.shape[1] / CELLS_ACROSS))
    size = height.shape[1] // side, height.shape[0] // side
    cells = cv2.resize(height, size, interpolation=cv2.INTER_AREA)
    smooth = cv2.GaussianBlur(cells, (0, 0), SMOOTH_CELLS)
    raised = cv2.resize(inside, size, interpolation=cv2.INTER_NEAREST) > 0
    curves_down = ((cv2.Laplacian(smooth, cv2.CV_32F) < 0) & raised).view(np.uint8)
    tops = cv2.morphologyEx(curves_down, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    raised &= smooth > LOW_SHARE * smooth.max()
    bridge = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * BRIDGE_CELLS + 1,) * 2)
    # A hollow of the object curves up as well, but leads to no film at rest.
    count, part = cv2.connectedComponents(1 - cv2.morphologyEx(tops, cv2.MORPH_CLOSE, bridge))
    hangs = np.isin(np.arange(count), part[~raised]).astype(np.uint8)
    hangs[0] = 0
    free = cv2.resize(hangs[part], height.shape[::-1], interpolation=cv2.INTER_NEAREST)
    share = float(np.mean(tops[raised])) if raised.any() else 0.0
    touched = np.stack([inside, inside & (1 - free)]) > 0
    return np.where(touched, height, np.float32(np.nan)), share
