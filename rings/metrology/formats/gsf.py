"""Gwyddion's simple field: 32-bit floats, NaN where unknown; it has room for no error."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tactograph.rings.metrology.formats._in_metres import (
    METRES_PER_MM,
    NOT_METRES,
    package_for,
    read_in_metres,
)
from tactograph.sdk import Height, HeightError, HeightFile, InputError


def write(file: Path, height: Height, pixel: float, error: HeightError | None) -> None:
    """Write heights in mm; the error is left out."""
    rows, columns = height.shape
    sizes = {"XReal": METRES_PER_MM * pixel * columns, "YReal": METRES_PER_MM * pixel * rows}
    about = {**sizes, "XYUnits": "m", "ZUnits": "m", "Title": "Height"}
    data = (METRES_PER_MM * height).astype(np.float32)
    package_for("gsf", "gsffile").write_gsf(file, data, about)


def read(file: Path) -> HeightFile:
    """Read the heights."""
    return read_in_metres(file, _field)


def _field(file: Path) -> Sequence[Any]:
    data, about = package_for("gsf", "gsffile").read_gsf(file)
    if about.get("ZUnits", "m") != "m" or about.get("XYUnits", "m") != "m":
        raise InputError(f"{file}: {NOT_METRES}")
    width, length = (float(about.get(key, math.nan)) for key in ("XReal", "YReal"))
    return width / data.shape[1], length / data.shape[0], data
