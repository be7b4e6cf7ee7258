"""Read the standard deviation that a result states of its height."""

from __future__ import annotations

from pathlib import Path

from tactograph.graph import InputError, node
from tactograph.nodes import HeightError
from tactograph.nodes.files.image_files import Crop
from tactograph.nodes.write.read_height import read_height

ERROR_FILE = "error.npy"


@node
def read_error(*, height: Path, crop: Crop | None = None) -> HeightError | None:
    """Read ``error.npy`` beside a height, in mm; None where a result states no error.

    Parameters
    ----------
    height
        The file of the height.
    crop
        x0, y0, x1, y1 in pixels, as the height is cropped.

    Raises
    ------
    InputError
        If it is damaged, or negative.
    """
    file = height.parent / ERROR_FILE
    if not file.is_file():
        return None
    error = read_height(file=file, crop=crop, unknown=True)
    if (error < 0).any():
        raise InputError(f"{file}: a standard deviation cannot be negative")
    return error
