"""ISO 25178-71, the format of softgauges: 64-bit floats, NaN where unknown; the error is left out.

Files of both versions of the standard are read, in text or binary; binary ones of the first are
written.
"""

from pathlib import Path

from tactograph.rings.metrology.formats._in_metres import read_in_metres
from tactograph.rings.metrology.nodes.surface.areal_surface import areal_surface, surface_in_metres
from tactograph.sdk import Height, HeightError, HeightFile, InputError

MAX_SIDE = 65535
"""Columns or rows that the format's 16 bits can state."""


def write(file: Path, height: Height, pixel: float, error: HeightError | None) -> None:
    """Write heights in mm; the error is left out.

    Raises
    ------
    InputError
        If surfalize is not installed, or there are more columns or rows than a file can state.
    """
    if max(height.shape) > MAX_SIDE:
        raise InputError(f"{file.name}: states {MAX_SIDE} columns or rows at most; write x3p")
    areal_surface(height, pixel).save(str(file))


def read(file: Path) -> HeightFile:
    """Read the heights; what was not measured is NaN."""
    return read_in_metres(file, surface_in_metres)
