"""Read a known height map: a result, or a calibration object's shape."""

from pathlib import Path

import numpy as np

from tactograph.graph import node
from tactograph.nodes import Height
from tactograph.nodes.files.height_files import HeightFile
from tactograph.nodes.files.image_files import Crop, cropped
from tactograph.nodes.files.stored_result import refuse_view


@node
def read_height(
    *, file: Path, crop: Crop | None = None, unknown: bool = False, distorted: bool = False
) -> Height:
    """Read a height map in mm.

    ``.npy``; ``.tiff`` of 32-bit floats; and the formats that rings bring, such as ``.png`` of 16
    bits that states its scale.

    Parameters
    ----------
    file : H x W, mm above the film at rest
    crop : x0, y0, x1, y1 in pixels; x1 and y1 are exclusive
    unknown : whether a part of the film may be unknown (NaN), as in a result with ``grid=metric``
    distorted
        Whether the height may be what a camera's pixels see by a lens or from near, as the
        ``result.json`` beside it states; the graph then has to read that view.

    Raises
    ------
    InputError
        If the file is missing, damaged, or no two-dimensional array of numbers, if it holds
        infinite heights or nothing but NaN, if it holds NaN without `unknown`, if the crop
        exceeds it, or if it is as a camera sees it, without `distorted`.
    """
    if not distorted:
        refuse_view(file)
    height = HeightFile.read(file).checked(file, unknown=unknown).height
    return np.ascontiguousarray(cropped(height, crop, file))


@read_height.handed_in
def _check_handed_in(height: Height, name: str) -> None:
    HeightFile(height).checked(Path(name))
