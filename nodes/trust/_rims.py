"""The share of a touch whose height hangs on rims that light cannot measure."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, Mask

TOUCHED_SHARE, TOUCHED_MM = 0.1, 0.02
"""Film is touched above this share of the greatest height, and above this height."""
MAX_RIM_SHARE = 0.25
"""Share from which on there is a warning; soft presses and a real sensor's balls stay below it."""


def rim_share(height: F4, rims: Mask) -> float:
    """Return the share of the touched film that hangs on rims."""
    hanging = int(hangs_on_rims(height, rims).sum())
    return hanging / int(_touched(height).sum()) if hanging else 0.0


def hangs_on_rims(height: F4, rims: Mask) -> NDArray[np.bool_]:
    """Return which touched film is rim (`rim_cells`), or is parted by rims from all other film.

    Heights are sums of slopes.  Where a path leads down to the film at rest and crosses no rim,
    the height is measured; what rims close in is as high as they rise, which light does not say.
    """
    if not rims.any():
        return np.zeros(rims.shape, bool)
    touched = _touched(height)
    count, parts = cv2.connectedComponents(1 - rims, connectivity=4)
    measured = np.zeros(count, bool)
    measured[parts[~touched]] = True
    measured[0] = False  # the rims
    return np.asarray(touched & ~measured[parts])


def _touched(height: F4) -> NDArray[np.bool_]:
    return np.asarray(height > max(TOUCHED_MM, TOUCHED_SHARE * float(height.max())))
