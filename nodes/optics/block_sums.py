"""Sums and means over square blocks of pixels."""

import cv2
import numpy as np

from tactograph.nodes import F4


def block_sums(plane: F4, side: int) -> F4:
    """Return the sums of an H x W plane over whole blocks of `side` x `side` pixels.

    Rows and columns that do not fill a block are left out.
    """
    rows, columns = (length // side for length in plane.shape)
    blocks = plane[: rows * side, : columns * side].reshape(rows, side, columns, side)
    return np.asarray(blocks.sum(axis=(1, 3)), np.float32)


def whole_cells(planes: F4, side: int) -> F4:
    """Return the means of N x H x W planes over complete cells of `side` x `side` pixels."""
    rows, columns = (length // side for length in planes.shape[1:])
    whole = planes[:, : rows * side, : columns * side]
    return np.stack([cv2.resize(p, (columns, rows), interpolation=cv2.INTER_AREA) for p in whole])
