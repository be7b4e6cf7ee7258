"""The film at rest: calm, and joined to the border of the frame."""

from __future__ import annotations

from typing import Annotated

import cv2
import numpy as np
from annotated_types import Interval

from tactograph.graph import node
from tactograph.nodes import Mask


@node
def rest_mask(calm: Mask, *, margin_px: Annotated[int, Interval(ge=0, le=64)] = 4) -> Mask:
    """Return where the film has height zero.

    A flat top looks as calm as the film at rest, but it is not joined to the border of the
    frame.  Single noisy pixels are closed first; the rest then keeps `margin_px` away from
    everything that is not calm.

    Parameters
    ----------
    calm
        H x W, as `calm_film` gives it.
    margin_px
        Distance kept from the touch.

    Returns
    -------
    ndarray
        H x W, 1 on the film at rest.
    """
    closed = cv2.morphologyEx(calm, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    _, parts = cv2.connectedComponents(closed, connectivity=4)
    border = np.unique(np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]]))
    joined = np.isin(parts, border[border > 0]).astype(np.uint8)
    square = np.ones((2 * margin_px + 1, 2 * margin_px + 1), np.uint8)
    return np.asarray(cv2.erode(joined, square, borderValue=1), np.uint8)
