"""The side of a pixel on the film, from the user, the camera's file or a usual value."""

from pathlib import Path
from typing import Annotated

from annotated_types import Len

from tactograph.graph import InputError, node, warn
from tactograph.nodes import PixelSize
from tactograph.nodes.files.calibration_file import FileKind
from tactograph.nodes.files.height_files import HeightFile
from tactograph.nodes.optics.lens import oblong_lens

PixelSides = PixelSize | Annotated[tuple[PixelSize, ...], Len(1, 2)]
"""Side of a pixel in mm, or x, y of one that is not square."""


@node
def pixel_size(
    stated: PixelSize | None = None,
    *,
    mm: PixelSides | None = None,
    camera: Path | None = None,
) -> PixelSize:
    """Return the pixel size as a value that nodes can take as input.

    Parameters
    ----------
    stated : mm per px, of a scan's file or a sensor's preset; used if nothing else is given
    mm
        mm per px; or x, y for pixels that are not square.  `read_lens` turns those into a lens, and
        this node returns the side of the ideal image's pixels.
    camera
        The file of a camera.  Its pixel size takes precedence over `mm` and `stated`, because
        images undistorted by it have that pixel size.

    Raises
    ------
    InputError
        If none is given, or the file is not a camera file.
    """
    if mm is not None:
        mm = oblong_lens(*sides_of(mm))[1]
    mm = mm or stated
    if camera is None:
        if mm is None:
            raise InputError("the pixel size is not known; give `mm`=MM, or `camera`=camera.npz")
        return mm
    of_camera = float(FileKind.named("camera").read(camera)[0]["pixel_size"])
    if mm is not None and not HeightFile.agree(mm, of_camera):
        warn(
            f"{camera}: states {of_camera:.6g} mm per px, which is used instead of {mm:.6g}, "
            "since images undistorted by it have that pixel size"
        )
    return of_camera


def sides_of(mm: PixelSides) -> tuple[float, float]:
    """Return a pixel's width and length."""
    sides = mm if isinstance(mm, tuple) else (mm,)
    return sides[0], sides[-1]
