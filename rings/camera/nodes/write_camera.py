"""Write the calibration of a camera's lens into one file."""

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator

from tactograph.rings.camera.calibrations.camera_kind import KIND, CameraLens
from tactograph.rings.camera.nodes.read_grey import GreyImage
from tactograph.sdk import Lens, PixelSize, Port, Provenance, node


@node
def write_camera(
    image: GreyImage,
    lens: Lens,
    pixel: PixelSize,
    residual: Annotated[float, Port(unit="px")],
    quality: dict[str, float],
    *,
    file: Annotated[Path, AfterValidator(KIND.new_file)],
    provenance: Provenance,
) -> None:
    """Write lens, pixel size and residual as one ``.npz``, readable without pickle.

    Parameters
    ----------
    image : H x W, the image of the grid; only its size is kept
    lens, pixel, residual : length 8, mm per px, and px: as `fit_lens` returns them
    quality : the figures of `fit_lens`, for people and for ``result.json``
    file : the file; it is replaced as a whole

    Raises
    ------
    InputError
        If the lens cannot be of a camera, the file's name does not end in ``.npz``, or it cannot
        be written.
    """
    size = np.array(image.shape[::-1], np.int32)
    record = CameraLens(lens, pixel, residual, size, quality)
    KIND.write_record(file, record, {"provenance": provenance})
