"""The share of a touch whose height hangs on rims that light cannot measure."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, U1

MAX_CELL_TURN = np.float32(1.25)
"""Change of the slope from cell to cell beyond which an edge lies within a cell, which shows the
mean of both sides."""
MIN_RIM_SLOPE = np.float32(1.0)
"""Slope of the steeper side from which on such an edge is a rim."""
MIN_DARK_LEDS = 2
"""LEDs in shadow from which on those that remain leave the slope open."""
TOUCHED_SHARE, TOUCHED_MM = 0.1, 0.02
"""Film is touched above this share of the greatest height, and above this height."""
MAX_RIM_SHARE = 0.25
"""Share from which on there is a warning; soft presses and a real sensor's balls stay below it."""


def rim_share(height: F4, slope: F4, shadow: U1) -> float:
    """Return the share of the touched film that hangs on rims."""
    touched = _touched(height)
    return float(hangs_on_rims(height, slope, shadow).sum() / max(touched.sum(), 1))


def hangs_on_rims(height: F4, slope: F4, shadow: U1) -> NDArray[np.bool_]:
    """Return which touched film is rim, or is parted by rims from all other film.

    Heights are sums of slopes.  Where a path leads down to the film at rest and crosses no rim,
    the height is measured; what rims close in is as high as they rise, which light does not say.
    """
    touched = _touched(height)
    rim = _edges(slope) | (np.bitwise_count(shadow) >= MIN_DARK_LEDS)
    _, parts = cv2.connectedComponents((~rim).astype(np.uint8), connectivity=4)
    measured = np.isin(parts, np.unique(parts[~touched & ~rim]))
    return np.asarray(touched & ~(measured & ~rim))


def _touched(height: F4) -> NDArray[np.bool_]:
    return np.asarray(height > max(TOUCHED_MM, TOUCHED_SHARE * float(height.max())))


def _edges(slope: F4) -> NDArray[np.bool_]:
    """Whether the slope changes too much to the next cell, on either side of the edge."""
    edge = np.zeros(slope.shape[1:], bool)
    across = np.hypot(*np.diff(slope, axis=2)) > MAX_CELL_TURN
    down = np.hypot(*np.diff(slope, axis=1)) > MAX_CELL_TURN
    for side in (edge[:, 1:], edge[:, :-1]):
        side |= across
    for side in (edge[1:], edge[:-1]):
        side |= down
    return edge & (np.hypot(*slope) > MIN_RIM_SLOPE)
