"""The side of a pixel on the film, from the user, the camera's file or the sensor's preset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from annotated_types import Interval

from tactograph.graph import InputError, node, warn
from tactograph.nodes import PixelSize
from tactograph.nodes.calibrate.file.camera_lens import CAMERA
from tactograph.nodes.files.calibration_file import read_arrays
from tactograph.nodes.files.sensor_preset import read_preset

MAX_DIFFERENCE = 0.005
"""Relative difference from the camera's file above which a stated size raises a warning."""


@node
def pixel_size(
    *,
    mm: Annotated[float, Interval(ge=1e-6, le=1e3)] | None = None,
    camera: Path | None = None,
    sensor: str | None = None,
) -> PixelSize:
    """Return the pixel size as a value that nodes can take as input.

    Parameters
    ----------
    mm
        mm per px, from a nanometre to a metre, which files of 32-bit floats can hold.
    camera
        A file from `write_camera`.  Its pixel size takes precedence over `mm`, because images
        undistorted by it have that pixel size.
    sensor
        A kind of sensor, as for `read_camera`; its pixel size is used if `mm` is not given.

    Raises
    ------
    InputError
        If none is given, there is no such sensor, or the file is not a camera file.
    """
    if mm is None and sensor is not None:
        mm = read_preset(sensor).pixel_size_mm
    if camera is None:
        if mm is None:
            raise InputError(
                "the pixel size is not known; give pixel_size_mm=..., or lens=camera.npz"
            )
        return mm
    found = float(read_arrays(camera, CAMERA)["pixel_size"])
    if mm is None:
        return found
    if abs(mm / found - 1) > MAX_DIFFERENCE:
        warn(
            f"{camera}: says {found:.6g} mm per px, which is taken in place of pixel_size_mm="
            f"{mm:.6g}: undistorted images have the camera's"
        )
    return found
