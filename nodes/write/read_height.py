"""Read a known height map: the truth, or a calibration object's shape."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tactograph.graph import InputError, node
from tactograph.nodes import Height
from tactograph.nodes.capture._image_files import Crop, read_truth
from tactograph.nodes.write._height_files import READERS


@node
def read_height(*, file: Path, crop: Crop | None = None) -> Height:
    """Read a height map in mm.

    ``.npy``; ``.tiff`` of 32-bit floats; ``.png`` of 16 bits that states its scale, as
    `export_height` writes it; ``.tmd``, GelSight's; ``.sur``, Digital Surf's.

    Parameters
    ----------
    file
        H x W, mm above the film at rest.
    crop
        x0, y0, x1, y1 in pixels; x1 and y1 are not part of it.

    Raises
    ------
    InputError
        If the file is missing, damaged, or no two-dimensional array of finite numbers, or
        the crop leaves it.
    """
    height = _read(file)
    if crop is None:
        return height
    x0, y0, x1, y1 = crop
    if not (0 <= x0 < x1 <= height.shape[1] and 0 <= y0 < y1 <= height.shape[0]):
        raise InputError(
            f"crop={x0},{y0},{x1},{y1}: {file} is {height.shape[1]} x {height.shape[0]}"
        )
    return np.ascontiguousarray(height[y0:y1, x0:x1])


def _read(file: Path) -> Height:
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        return read_truth(file)
    if not file.is_file():
        raise InputError(f"{file}: there is no such file")
    height = reader(file)
    if not np.isfinite(height).all():
        raise InputError(f"{file}: holds NaN or infinite values")
    return height
