"""Write the calibration of a camera's lens into one file."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator

from tactograph.graph import Port, Provenance, node
from tactograph.nodes import Lens, Metrics, PixelSize
from tactograph.nodes.capture.read_grey import GreyImage
from tactograph.nodes.files.calibration_file import FileKind, Stored, free_for, write_arrays

CAMERA = FileKind(
    "camera",
    1,
    "run calibrate_camera",
    {
        "lens": Stored(
            "8",
            "k1, k2, cx, cy of the radial distortion (L2), a, b, gx, gy of the tilt (L1); places "
            "from the image's middle in halves of its diagonal; zeros: none",
            low=-10,
            high=10,
        ),
        "pixel_size": Stored(
            "", "mm/px on the film at rest, of the ideal image", low=1e-6, high=1e3
        ),
        "residual": Stored(
            "", "px, root mean square distance of the marks from the fit", low=0, high=1e4
        ),
        "size": Stored(
            "2", "px, columns and rows of the images that it holds for", np.int32, low=1, high=1e5
        ),
    },
    made_from="the image of the grid and its pitch",
)
NewCamera = Annotated[Path, AfterValidator(partial(free_for, kind=CAMERA))]


@node
def write_camera(
    image: GreyImage,
    lens: Lens,
    pixel: PixelSize,
    residual: Annotated[float, Port(unit="px")],
    quality: Metrics,
    *,
    file: NewCamera,
    provenance: Provenance,
) -> None:
    """Write lens, pixel size and residual as one ``.npz``, readable without pickle.

    Parameters
    ----------
    image
        H x W, the image of the grid; only its size is kept.
    lens, pixel, residual
        As `fit_lens` returns them.
    quality
        The figures of `fit_lens`, for people and for ``result.json``.
    file
        The file; it is replaced as a whole.

    Raises
    ------
    InputError
        If the lens cannot be of a camera, the file's name does not end in ``.npz``, or it cannot
        be written.
    """
    rows, columns = image.shape
    arrays = {"lens": lens, "pixel_size": pixel, "residual": residual, "size": (columns, rows)}
    write_arrays(file, CAMERA, arrays, {"quality": quality, "made": provenance})
