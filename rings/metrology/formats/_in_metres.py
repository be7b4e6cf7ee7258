"""What the formats of surface metrology share: lengths in metres, a library for each."""

import importlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.constants import milli

from tactograph.sdk import HeightFile, InputError, need
from tactograph.sdk.unstable import MAX_PIXEL_MM


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
    if max(width, length) > MAX_PIXEL_MM * milli:
        raise InputError(
            f"{file}: says {width / milli:.4g} mm per px; are its lengths in mm, where "
            "metres belong? Write it again in metres"
        )
    height, *stated = ((np.asarray(one) / milli).astype(np.float32) for one in maps)
    sides = width / milli, length / milli
    return HeightFile.of(height, *sides, stated[0] if stated else None)
