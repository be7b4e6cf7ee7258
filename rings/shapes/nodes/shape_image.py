"""A height map from a file."""

from pathlib import Path

import numpy as np

from tactograph.sdk import F8, ImageFile, InputError, Length, Shape, ShapeImage, node

PAPER_PIXEL_MM = ShapeImage().pixel_size_mm


@node
def shape_image(
    *,
    file: Path,
    rise_mm: Length | None = None,
    pixel_size_mm: Length = PAPER_PIXEL_MM,
) -> Shape:
    """Return the height stored in a picture or an array; the image has the same size.

    Parameters
    ----------
    file : PNG, TIFF, PGM, BMP (grey; 8 or 16 bit, or a float TIFF) or NPY, H x W
    rise_mm
        Height of full scale: white for integers, 1.0 for floats.  By default floats are in mm;
        integers need this parameter.
    pixel_size_mm : side of a pixel of the file

    Returns
    -------
    Height H x W, mm (negative values become 0), and the pixel size.

    Raises
    ------
    InputError
        If the file cannot be read, is not two-dimensional or not finite, or needs `rise_mm`.
    """
    values = ImageFile(file).read()
    if values.ndim != 2:
        raise InputError(f"{file} is not grey (its shape is {values.shape}); convert")
    if values.dtype.kind not in "iuf":
        raise InputError(f"{file} holds {values.dtype}, not numbers; convert it")
    if values.dtype.kind in "iu":
        if rise_mm is None:
            raise InputError(f"{file} holds integers; say with `rise_mm` what white is")
        return Shape.of(values / np.iinfo(values.dtype).max * rise_mm, pixel_size_mm)
    height: F8 = values.astype(float) * (1.0 if rise_mm is None else rise_mm)
    if not np.isfinite(height).all():
        raise InputError(f"{file} holds values that are not finite; fill them first")
    return Shape.of(height, pixel_size_mm)
