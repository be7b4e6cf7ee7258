"""Read the parts of the error of a height that a known step has settled."""

from pathlib import Path

import numpy as np

from tactograph.graph import InputError, node
from tactograph.nodes.files.height_files import read_height_file
from tactograph.nodes.files.image_files import Crop, read_numbers
from tactograph.nodes.metrology.measure_step import ErrorParts

PARTS_FILE = "error_parts.npy"


@node
def read_error_parts(*, height: Path, crop: Crop | None = None) -> ErrorParts | None:
    """Read ``error_parts.npy`` beside a height, on cells; None where there is none.

    Parameters
    ----------
    height
        The file of the height.
    crop
        x0, y0, x1, y1 in pixels, as the height is cropped.

    Raises
    ------
    InputError
        If it is damaged.
    """
    file = height.parent / PARTS_FILE
    if not file.is_file():
        return None
    parts = read_numbers(file)
    rows, columns = read_height_file(height).height.shape
    cell = -(-rows // parts.shape[1]) if parts.ndim == 3 and parts.size else 0
    if not cell or parts.shape[2] != -(-columns // cell) or not np.isfinite(parts).all():
        raise InputError(f"{file}: is damaged, or of another height; run the reconstruction again")
    x0, y0, x1, y1 = crop or (0, 0, columns, rows)
    there = slice(y0 // cell, -(-y1 // cell)), slice(x0 // cell, -(-x1 // cell))
    return np.asarray(parts[:, *there], np.float32)
