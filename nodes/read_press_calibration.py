"""Read the calibration of a one-shot sensor, and refuse anything that is not a whole one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError, node
from tactograph.nodes import Dark, Light, PixelSize
from tactograph.nodes._reflectance_map import SHADES, TERMS
from tactograph.nodes.read_calibration import _load
from tactograph.nodes.read_capture import Lights
from tactograph.nodes.read_presses import read_film
from tactograph.nodes.solve_reflectance_map import ReflectanceMap
from tactograph.nodes.write_press_calibration import FORMAT, KIND

MAKE = "'run calibrate_presses' makes one"
AXES = {"flat": 3, "pixel_size": 0, "reflectance": 3}


class PressCalibration(NamedTuple):
    """What `write_press_calibration` wrote; the camera's black is taken to be 0."""

    flat: Light
    dark: Dark
    pixel_size: PixelSize
    reflectance: ReflectanceMap


@node
def read_press_calibration(
    *, file: Path, flat: Path | None = None, lights: Lights = "bgr"
) -> PressCalibration:
    """Read the ``.npz`` that `write_press_calibration` wrote, without pickle.

    Parameters
    ----------
    file
        The calibration.
    flat
        A fresh capture of the untouched film, which then stands for the one in the file.
    lights
        How that capture's images hold the lights, as for `read_capture`.

    Raises
    ------
    InputError
        If the file is missing, damaged, of another kind or version, or holds a pickle or an
        array that is missing, misshapen or not finite; if the fresh film has another size.
    """
    arrays = _load(file)
    _check_about(file, arrays)
    for name, axes in AXES.items():
        _check_array(file, name, arrays.get(name), axes)
    film, reflectance = arrays["flat"], arrays["reflectance"]
    if reflectance.shape != (len(film), SHADES, TERMS):
        raise InputError(
            f"{file}: 'reflectance' has shape {reflectance.shape}, not "
            f"{(len(film), SHADES, TERMS)}; calibrate again"
        )
    pixel = float(arrays["pixel_size"])
    if pixel <= 0:
        raise InputError(f"{file}: the pixel size {pixel} is not positive; calibrate again")
    if flat is not None:
        film = _fresh(flat, lights, film)
    return PressCalibration(film, np.zeros(film.shape[1:], np.float32), pixel, reflectance)


def _fresh(flat: Path, lights: Lights, film: Light) -> Light:
    found = read_film(flat, lights, 2.0)
    if found.shape != film.shape:
        raise InputError(
            f"{flat}: is {found.shape[2]} x {found.shape[1]} pixels, but the calibration is for "
            f"{film.shape[2]} x {film.shape[1]}"
        )
    return found


def _check_about(file: Path, arrays: dict[str, NDArray[Any]]) -> None:
    try:
        about = json.loads(str(arrays["about"]))
        kind, version = about["kind"], about["format"]
    except (KeyError, ValueError, TypeError):
        raise InputError(f"{file}: not a press calibration; {MAKE}") from None
    if kind != KIND:
        raise InputError(f"{file}: is a {kind}, not a press calibration; {MAKE}")
    if version != FORMAT:
        raise InputError(
            f"{file}: press calibration format {version}, but this version reads {FORMAT}; "
            "calibrate again"
        )


def _check_array(file: Path, name: str, array: NDArray[Any] | None, axes: int) -> None:
    if array is None:
        raise InputError(f"{file}: the calibration is incomplete: '{name}' is missing; {MAKE}")
    if array.dtype != np.float32 or array.ndim != axes:
        raise InputError(f"{file}: '{name}' is {array.dtype} of shape {array.shape}; {MAKE}")
    if not np.isfinite(array).all():
        raise InputError(f"{file}: '{name}' holds NaN or infinite values; calibrate again")
