"""The calibration of a camera's lens: each of its values, declared once."""

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.sdk import FileKind, Lens, PixelSize, Port, Stored, View


class CameraLens(NamedTuple):
    """The lens of a camera, and the image size for which it is valid."""

    lens: Annotated[
        Lens,
        Stored(-10, 10),
        "k1, k2, cx, cy of the radial distortion (L2), a, b, gx, gy of the tilt (L1); places "
        "from the image's middle in halves of its diagonal; zeros: none",
    ]
    pixel_size: Annotated[
        PixelSize, Stored(1e-6, 1e3), "mm/px on the film at rest, of the ideal image"
    ]
    residual: Annotated[
        float,
        Port(unit="px"),
        Stored(0, 1e4),
        "px, root mean square distance of the marks from the fit",
    ]
    size: Annotated[
        NDArray[np.int32],
        Port("2", "px"),
        Stored(1, 1e5),
        "px, columns and rows of the images for which it is valid",
    ]
    quality: dict[str, float]


KIND = FileKind(
    "camera",
    1,
    "run calibrate_camera",
    CameraLens,
    sources="the image of the grid and its pitch",
    users="a camera's lens",
)
MARKS_ACROSS = 12
"""Places across the image at which a lens's displacement is drawn."""


def draw(figure: Any, arrays: Mapping[str, Any]) -> None:
    """Draw the displacements at which the camera sees places of an even grid."""
    columns, rows = (int(side) for side in arrays["size"])
    figure.set_size_inches(8, 8 * rows / columns + 1)
    axes = figure.subplots()
    step = max(columns // MARKS_ACROSS, 1)
    half = View.unit((rows, columns))
    y, x = np.mgrid[:rows:step, :columns:step]
    u, v = (x - (columns - 1) / 2) / half, (y - (rows - 1) / 2) / half
    du, dv = View(arrays["lens"]).offset(u, v)
    places = [x + half * du, y + half * dv]
    axes.plot(x.ravel(), y.ravel(), ".", color="#9a9a9a", label="even grid")
    axes.plot(
        *(plane.ravel() for plane in places), "+", color="#ffb000", label="as the camera sees it"
    )
    axes.set(xlabel="x / px", ylabel="y / px", aspect="equal")
    axes.invert_yaxis()
    axes.legend()
