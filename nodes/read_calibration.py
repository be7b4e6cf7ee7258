"""Read a calibration, and refuse anything that is not a whole one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NamedTuple

from tactograph.graph import InputError, Port, node
from tactograph.nodes import (
    F4,
    Dark,
    Light,
    LightPositions,
    LutLight,
    LutLit,
    LutSlope,
    Noise,
    NullVector,
    PixelSize,
    Reflectance,
    Spread,
)
from tactograph.nodes._calibration_file import read_arrays
from tactograph.nodes.write_calibration import CALIBRATION


class Calibration(NamedTuple):
    """What `write_calibration` wrote."""

    flat: Light
    dark: Dark
    pixel_size: PixelSize
    lut_light: LutLight
    lut_slope: LutSlope
    lut_lit: LutLit
    reflectance: Reflectance
    residual: Annotated[F4, Port("K", "1")]
    null: NullVector
    spread: Spread
    lights: LightPositions
    noise: Noise


@node
def read_calibration(*, file: Path) -> Calibration:
    """Read the ``.npz`` that `write_calibration` wrote, without pickle.

    Parameters
    ----------
    file
        The calibration.

    Raises
    ------
    InputError
        If the file is missing, damaged, of another version, holds a pickle, or an array
        that is missing, misshapen, or not finite.
    """
    found = read_arrays(file, CALIBRATION)
    if (found["lights"][:, 2] <= 0).any():
        raise InputError(f"{file}: 'lights' holds an LED that is not above the film")
    return Calibration(**found)
