"""Read the standard deviation that a result states of its height."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from tactograph.graph import InputError, node
from tactograph.nodes import HeightError
from tactograph.nodes.files.height_files import read_height_file
from tactograph.nodes.files.image_files import Crop, read_numbers
from tactograph.nodes.write.read_height import checked_heights
from tactograph.rings.metrology.nodes.surface.measure_step import ErrorParts, parts_within

ERROR_FILE, PARTS_FILE = "error.npy", "error_parts.npy"


class StatedError(NamedTuple):
    """The error in mm, and its parts where a known step settled it; None where unknown."""

    error: HeightError | None = None
    parts: ErrorParts | None = None


@node
def read_error(*, height: Path, crop: Crop | None = None) -> StatedError:
    """Read what a height's file states as its error, else ``error.npy`` beside it.

    Its parts, on cells, are in ``error_parts.npy``.

    Parameters
    ----------
    height : the file of the height
    crop : x0, y0, x1, y1 in pixels, as the height is cropped

    Raises
    ------
    InputError
        If it is damaged, or negative.
    """
    file, stated = height, read_height_file(height).error
    if stated is None:
        file = height.parent / ERROR_FILE
        if not file.is_file():
            return StatedError()
        stated = read_height_file(file).height
    error = checked_heights(stated, file, crop, unknown=True)
    if (error < 0).any():
        raise InputError(f"{file}: a standard deviation cannot be negative")
    of_parts = height.parent / PARTS_FILE
    if file == height or not of_parts.is_file():
        return StatedError(error)
    parts = read_numbers(of_parts)
    if parts.ndim != 3 or not parts.size or not np.isfinite(parts).all():
        raise InputError(f"{of_parts}: is damaged; run the reconstruction again")
    return StatedError(error, parts_within(parts, crop, stated.shape))
