"""Digital Surf's format, which MountainsMap and Gwyddion read: 32-bit steps; NaN: unknown."""

import struct
from pathlib import Path

import numpy as np

from tactograph.rings.metrology.formats._in_metres import read_in_metres
from tactograph.rings.metrology.nodes.surface.areal_surface import (
    areal_surface,
    surface_in_metres,
    surfalize,
)
from tactograph.sdk import Height, HeightError, HeightFile, ImageFile, InputError

COLUMNS_AT, COLUMNS_AND_ROWS = 108, struct.Struct("<2i")
"""Position of the numbers of columns and rows."""


def write(file: Path, height: Height, pixel: float, error: HeightError | None) -> None:
    """Write heights in mm; the error is left out.

    Raises
    ------
    InputError
        If surfalize is not installed, or all heights are the same: the file's steps divide the
        range of the heights.
    """
    # First, so that a missing library is reported whatever the heights are.
    surfalize()
    known_heights = height[np.isfinite(height)]
    if not known_heights.size or known_heights.min() == known_heights.max():
        raise InputError(
            f"{file.name}: all heights are the same, which a .sur file cannot hold; write tmd or "
            "tiff"
        )
    surface = areal_surface(np.where(np.isfinite(height), height, np.nan), pixel)
    # The format is older than UTF-8: its unit is a micro sign of one byte.
    surface.save(str(file), encoding="latin-1")


def read(file: Path) -> HeightFile:
    """Read the heights; what was not measured is NaN."""
    surfalize()
    with file.open("rb") as opened:
        header = opened.read(COLUMNS_AT + COLUMNS_AND_ROWS.size)
    if len(header) < COLUMNS_AT + COLUMNS_AND_ROWS.size:
        raise InputError(f"{file}: ends within its header")
    columns, rows = COLUMNS_AND_ROWS.unpack_from(header, COLUMNS_AT)
    if min(columns, rows) < 1 or columns * rows > ImageFile.MAX_PIXELS:
        raise InputError(f"{file}: says {columns} x {rows} heights, which no sensor has")
    return read_in_metres(file, surface_in_metres)
