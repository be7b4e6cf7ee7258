"""What the formats of surface metrology share: lengths in metres, a library for each."""

import importlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError
from scipy.constants import milli

from tactograph.sdk import HeightFile, InputError, PixelSize, need


def package_for(kind: str, package: str) -> Any:
    """The library that reads and writes a format.

    Raises
    ------
    InputError
        If it is not installed.
    """
    need("metrology", f"a .{kind} file", package)
    return importlib.import_module(package)


def read_in_metres(file: Path, read: Callable[[Path], Sequence[Any]]) -> HeightFile:
    """Read width and length of a pixel, heights and their error, all in metres.

    Raises
    ------
    InputError
        If the file is damaged.
    """
    try:
        width, length, *maps = read(file)
    except InputError:
        raise
    # A damaged file can raise any exception.
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{file}: cut off, damaged or no {file.suffix} file: {reason}") from None
    sides = width / milli, length / milli
    try:
        TypeAdapter(PixelSize).validate_python(max(sides))
    except ValidationError:
        raise InputError(
            f"{file}: says {sides[0]:.4g} mm per px; are its lengths in mm, where metres belong? "
            "Write it again in metres"
        ) from None
    height, *stated = ((np.asarray(one) / milli).astype(np.float32) for one in maps)
    return HeightFile.of(height, *sides, stated[0] if stated else None)
