"""Read the distortion and tilt of a camera."""

from pathlib import Path

import numpy as np

from tactograph.graph import InputError, node
from tactograph.nodes import Lens, Light
from tactograph.nodes.calibrate.camera.pixel_size import PixelSides, sides_of
from tactograph.nodes.files.calibration_file import FileKind
from tactograph.nodes.optics.lens import LENS_TERMS, oblong_lens


@node
def read_lens(
    image: Light, *, file: Path | None = None, pixel_mm: PixelSides | None = None
) -> Lens:
    """Read the lens from the ``.npz`` of a camera.

    Parameters
    ----------
    image : K x H x W, the image to undistort, for its size
    file : the camera; None: an ideal lens, eight zeros
    pixel_mm
        mm per px; or x, y for pixels that are not square, which count as a lens if there is no
        `file`.

    Raises
    ------
    InputError
        If the file is missing, damaged, of another kind or version, or was made with images
        of another size.
    """
    if file is None and pixel_mm is not None:
        return oblong_lens(*sides_of(pixel_mm))[0]
    if file is None:
        return np.zeros(len(LENS_TERMS), np.float32)
    arrays, _ = FileKind.named("camera").read(file)
    columns, rows = arrays["size"]
    if image.shape[1:] != (rows, columns):
        raise InputError(
            f"{file}: was made with an image of {columns} x {rows} pixels, but these have "
            f"{image.shape[2]} x {image.shape[1]}; take and crop the grid's image like the captures"
        )
    return np.asarray(arrays["lens"], np.float32)
