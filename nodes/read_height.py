"""Read a known height map: the truth, or a calibration object's shape."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tactograph.graph import InputError, node
from tactograph.nodes import Height
from tactograph.nodes.read_capture import Crop, read_truth


@node
def read_height(*, file: Path, crop: Crop | None = None) -> Height:
    """Read a height map in mm from a ``.npy`` file.

    Parameters
    ----------
    file
        H x W, mm above the film at rest.
    crop
        x0, y0, x1, y1 in pixels; x1 and y1 are not part of it.

    Raises
    ------
    InputError
        If the file is no two-dimensional array of finite numbers, or the crop leaves it.
    """
    height = read_truth(file)
    if crop is None:
        return height
    x0, y0, x1, y1 = crop
    if not (0 <= x0 < x1 <= height.shape[1] and 0 <= y0 < y1 <= height.shape[0]):
        raise InputError(
            f"crop={x0},{y0},{x1},{y1}: {file} is {height.shape[1]} x {height.shape[0]}"
        )
    return np.ascontiguousarray(height[y0:y1, x0:x1])
