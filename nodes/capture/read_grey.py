"""Read one grey image, such as that of a grid on the film."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np

from tactograph.graph import InputError, Port, node
from tactograph.nodes import F4
from tactograph.nodes.files.image_files import Crop, cropped, grey, read_image

GreyImage = Annotated[F4, Port("H W", "1")]
"""One image as a fraction of full scale."""


@node
def read_grey(*, file: Path, crop: Crop | None = None) -> GreyImage:
    """Read one image file as fractions of full scale.

    Parameters
    ----------
    file
        8 or 16 bit grey; PNG, TIFF, PGM or BMP.
    crop
        x0, y0, x1, y1 in pixels; x1 and y1 are exclusive.

    Raises
    ------
    InputError
        If the file is missing, damaged, coloured or of another depth, or the crop exceeds it.
    """
    plane = cropped(grey(read_image(file), file), crop, file)
    if plane.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{file}: {plane.dtype} pixels; 8 or 16 bit grey is needed")
    return np.asarray(plane / np.float32(np.iinfo(plane.dtype).max), np.float32)
