"""The share of a touch whose height hangs on rims that light cannot measure."""

from __future__ import annotations

import cv2
import numpy as np

from tactograph.nodes import F4, U1

STEEPEST_MEASURED = np.float32(2.0)
"""Slope up to which light, the mean of a cell, tells how far film rises."""
MIN_DARK_LEDS = 2
"""LEDs in shadow from which on those that remain leave the slope open."""
TOUCHED_SHARE, TOUCHED_MM = 0.1, 0.02
"""Film is touched above this share of the greatest height, and above this height."""
MAX_RIM_SHARE = 0.2
"""Share from which on there is a warning: soft presses and balls of a real sensor stay below it."""


def rim_share(height: F4, slope: F4, shadow: U1) -> float:
    """Return the share of the touched film that is rim, or that rims part from all other film.

    Heights are sums of slopes.  Where a path leads down to the film at rest and crosses no rim,
    the height is measured; what rims close in is as high as they rise, which light does not say.
    """
    touched = height > max(TOUCHED_MM, TOUCHED_SHARE * float(height.max()))
    if not touched.any():
        return 0.0
    steep = (slope * slope).sum(axis=0) > STEEPEST_MEASURED**2
    rim = steep | (np.bitwise_count(shadow) >= MIN_DARK_LEDS)
    _, parts = cv2.connectedComponents((~rim).astype(np.uint8), connectivity=4)
    measured = np.isin(parts, np.unique(parts[~touched & ~rim]))
    return float((touched & ~(measured & ~rim)).sum() / touched.sum())
