"""Read the calibration of a one-shot sensor, and refuse an incomplete or damaged one."""

from pathlib import Path

import numpy as np

from tactograph.rings.oneshot.nodes.file.press_calibration import (
    PRESS_CALIBRATION,
    PressCalibration,
)
from tactograph.rings.oneshot.nodes.map.slope_in_shadow import matt_deviation
from tactograph.sdk import Crop, Lights, node
from tactograph.sdk.nodes import read_flat, undistort


@node
def read_press_calibration(
    *,
    file: Path,
    flat: Path | None = None,
    lights: Lights | None = None,
    crop: Crop | None = None,
) -> PressCalibration:
    """Read the ``.npz`` that `write_press_calibration` wrote, without pickle.

    A warning repeats what made the calibration doubtful.

    Parameters
    ----------
    file : the calibration
    flat : a new capture of the untouched film, which replaces the one in the file
    lights
        How that capture's images, and those that the calibration is used for, hold the lights,
        as for `read_capture`.  None: as those of the calibration did.
    crop : x0, y0, x1, y1 in pixels of that capture; x1 and y1 are exclusive

    Raises
    ------
    InputError
        If the file is missing, damaged, of another kind or version, or holds a pickle; if an
        array is missing, misshapen, not finite or out of range; if the new film image has
        another size; if the calibration was made from lights of another order.
    """
    arrays, about = PRESS_CALIBRATION.read_to_use(file, lights)
    order = lights or ("rgb" if about.lights == "rgb" else "bgr")
    lens = arrays["lens"]
    film = arrays["flat"]
    if flat is not None:
        film = undistort(read_flat(film, folder=flat, lights=order, crop=crop).flat, lens)
    dark = np.zeros(film.shape[1:], np.float32)
    quality, size, reflectance = about.quality, arrays["pixel_size"], arrays["reflectance"]
    error = quality.get("residual_percent", 0.0) / 100
    misfit = np.array([error, 0, error, 0, 0], np.float32)
    details = quality, about.doubts, arrays["area"], lens, about.serial, arrays["ranks"]
    walls, matt = quality.get("wall_gain", 0.0), matt_deviation(quality, error)
    return PressCalibration(film, dark, size, reflectance, misfit, *details, walls, matt)
