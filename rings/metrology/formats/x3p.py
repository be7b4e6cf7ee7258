"""ISO 25178-72: 64-bit floats, NaN where unknown; the error is a second layer."""

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from tactograph.rings.metrology.formats._in_metres import (
    METRES_PER_MM,
    package_for,
    read_in_metres,
)
from tactograph.sdk import Height, HeightError, HeightFile, InputError

SOFTWARE_NAME = "Tactograph"
"""What files name as their writer, and whose second layer is an error."""


def write(file: Path, height: Height, pixel: float, error: HeightError | None) -> None:
    """Write heights in mm, and their standard deviation if it is known."""
    layers = [height] if error is None else [height, error]
    data = METRES_PER_MM * np.stack(layers).astype(np.float64)
    package, side = package_for("x3p", "x3pio"), METRES_PER_MM * pixel
    about = package.Metadata.for_software(SOFTWARE_NAME, version("tactograph"))
    package.write(file, data, x_scale=side, y_scale=side, metadata=about)


def read(file: Path) -> HeightFile:
    """Read the first layer; the second is its error where this software wrote it."""
    return read_in_metres(file, _layers)


def _layers(file: Path) -> Sequence[Any]:
    found = package_for("x3p", "x3pio").read(file)
    layers = found.layers
    if not layers or np.asarray(getattr(layers[0], "z", 0)).ndim != 2:
        raise InputError(f"{file}: holds no surface, but a profile or points")
    known = 2 if found.metadata and found.metadata.instrument.model == SOFTWARE_NAME else 1
    return *layers[0].spacing, *(one.z for one in layers[:known])
