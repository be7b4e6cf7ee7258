"""Read an array between its pixels."""

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4


def bilinear(plane: F4, x: F4, y: F4) -> F4:
    """Interpolate `plane` (H x W) at the points (x, y) in px; border pixels are replicated."""
    rows, columns = plane.shape
    column = np.clip(np.floor(x), 0, columns - 1).astype(np.int32)
    upper = np.clip(np.floor(y), 0, rows - 1).astype(np.int32)
    right, lower = np.minimum(column + 1, columns - 1), np.minimum(upper + 1, rows - 1)
    u = np.clip(x - column.astype(np.float32), 0, 1)
    v = np.clip(y - upper.astype(np.float32), 0, 1)
    above = plane[upper, column] * (1 - u) + plane[upper, right] * u
    below = plane[lower, column] * (1 - u) + plane[lower, right] * u
    return np.asarray(above * (1 - v) + below * v, np.float32)


def mask_at(mask: NDArray[np.bool_], x: F4, y: F4) -> NDArray[np.bool_]:
    """Return `mask` at the pixels nearest to the points (x, y) in px; False outside the frame."""
    rows, columns = mask.shape
    column, row = np.rint(x).astype(int), np.rint(y).astype(int)
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    return inside & mask[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]
