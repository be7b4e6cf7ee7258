"""The side of a pixel on the film, as the user states it, or as the camera's file does."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from annotated_types import Interval

from tactograph.graph import InputError, node, warn
from tactograph.nodes import PixelSize
from tactograph.nodes.calibrate._calibration_file import read_arrays
from tactograph.nodes.calibrate.write_camera import CAMERA
from tactograph.nodes.live._sensor_preset import read_preset

APART = 0.005
"""A stated size that departs by more from the camera's file is remarked on."""


@node
def pixel_size(
    *,
    mm: Annotated[float, Interval(ge=1e-6, le=1e3)] | None = None,
    camera: Path | None = None,
    sensor: str | None = None,
) -> PixelSize:
    """Return the pixel size, so that nodes can read it like any other value.

    Parameters
    ----------
    mm
        mm per px; from a nanometre to a metre, which files of 32-bit floats can hold.
    camera
        What `write_camera` wrote: its pixel size goes before `mm`, since images that are
        undistorted by it have it.
    sensor
        A kind of sensor, as for `read_camera`: its pixel size counts where `mm` is not given.

    Raises
    ------
    InputError
        If none is given, there is no such sensor, or the file is no camera's.
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
    if abs(mm / found - 1) > APART:
        warn(
            f"{camera}: says {found:.6g} mm per px, which is taken in place of pixel_size_mm="
            f"{mm:.6g}: undistorted images have the camera's"
        )
    return found
