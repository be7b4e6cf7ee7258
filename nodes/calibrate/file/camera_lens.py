"""The calibration of a camera's lens: each of its values, declared once."""

from typing import Annotated, NamedTuple

from tactograph.graph import Port
from tactograph.nodes import I4, Lens, Metrics, PixelSize
from tactograph.nodes.files.calibration_file import FileKind
from tactograph.nodes.stored import Stored


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
        I4,
        Port("2", "px"),
        Stored(1, 1e5),
        "px, columns and rows of the images for which it is valid",
    ]
    quality: Metrics


CAMERA_KIND = FileKind(
    "camera",
    1,
    "run calibrate_camera",
    CameraLens,
    sources="the image of the grid and its pitch",
    users="a camera's lens",
)
