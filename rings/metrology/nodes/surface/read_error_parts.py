"""Read the parts of the error that a result states of its height."""

from pathlib import Path

import numpy as np

from tactograph.rings.metrology.nodes.surface.measure_step import ErrorParts, parts_within
from tactograph.sdk import Crop, HeightFile, ImageFile, InputError, node

PARTS_FILE = "error_parts.npy"


@node
def read_error_parts(*, height: Path, crop: Crop | None = None) -> ErrorParts | None:
    """Read ``error_parts.npy`` beside a height whose own file states no error.

    Parameters
    ----------
    height : the file of the height
    crop : x0, y0, x1, y1 in pixels, as the height is cropped

    Returns
    -------
    The parts on cells, in mm; None where no known step has settled the height's scale.

    Raises
    ------
    InputError
        If it is damaged.
    """
    file, stated = height.parent / PARTS_FILE, HeightFile.read(height)
    if stated.error is not None or not file.is_file():
        return None
    parts = ImageFile(file).read()
    if parts.ndim != 3 or not parts.size or not np.isfinite(parts).all():
        raise InputError(f"{file}: is damaged; run the reconstruction again")
    return parts_within(parts, crop, stated.height.shape)
