"""Read the standard deviation that a result states of its height."""

from pathlib import Path

import numpy as np

from tactograph.sdk import Crop, HeightError, HeightFile, InputError, Layout, node

ERROR_FILE = "error.npy"


@node
def read_error(*, height: Path, crop: Crop | None = None) -> HeightError | None:
    """Read what a height's file states as its error, else ``error.npy`` beside it.

    Parameters
    ----------
    height : the file of the height
    crop : x0, y0, x1, y1 in pixels, as the height is cropped

    Returns
    -------
    H x W in mm; None where it is unknown.

    Raises
    ------
    InputError
        If it is damaged, or negative.
    """
    file, stated = height, HeightFile.read(height).error
    if stated is None:
        file = height.parent / ERROR_FILE
        if not file.is_file():
            return None
        stated = HeightFile.read(file).height
    HeightFile(stated).checked(file, unknown=True)
    error: HeightError = np.ascontiguousarray(Layout(crop=crop).cropped(stated, file))
    if (error < 0).any():
        raise InputError(f"{file}: a standard deviation cannot be negative")
    return error
