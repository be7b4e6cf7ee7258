"""The side of a pixel of a stored height map: given, or as its file or its result states it."""

import math
from pathlib import Path
from typing import Annotated

from annotated_types import Interval

from tactograph.sdk import RESULT_FILE, InputError, PixelSize, node, read_height_file, warn
from tactograph.sdk.unstable import MAX_PIXEL_MM, MAX_SIZE_DIFFERENCE, MIN_PIXEL_MM, read_result


@node
def read_pixel_size(
    *, height: Path, mm: Annotated[float, Interval(ge=MIN_PIXEL_MM, le=MAX_PIXEL_MM)] | None = None
) -> PixelSize:
    """Return the pixel size of a height map in mm.

    ``.sur``, ``.tmd``, and the ``.tiff`` and ``.png`` that Tactograph writes state it
    themselves.  For the others, the ``result.json`` in the same folder states it.  Pixels that
    are not square have no size.

    Parameters
    ----------
    height
        The height map: .npy, .tiff, .png (16 bit, with its scale), .tmd, .sur, .sdf, .x3p or .gwy.
    mm
        mm per px.  It takes precedence; a file that contradicts it raises a warning.

    Raises
    ------
    InputError
        If neither says it, a result's pixels are not square, or the file is missing or damaged.
    """
    result = height.parent / RESULT_FILE
    stated, where = read_height_file(height).pixel, height
    if stated is None:
        stated, where = _size_in(height.parent), result
    if mm is None:
        if stated is None:
            raise InputError(f"{height}: states no pixel size, nor does {result}; give `mm`=MM")
        return stated
    if stated is not None and not math.isclose(mm, stated, rel_tol=MAX_SIZE_DIFFERENCE):
        warn(
            f"{where}: says {stated:.6g} mm per px, but `mm`={mm:.6g} is given and used; "
            "leave it out to use the file's"
        )
    return mm


def _size_in(folder: Path) -> float | None:
    """Return the pixel size of a folder's result; None if it is no result, or an older one."""
    result = read_result(folder)
    size = result.get("pixel_size_mm")
    if isinstance(size, bool) or not isinstance(size, int | float):
        return None
    match result.get("pixel_sides_mm"):
        case [float(width), float(length)] if not math.isclose(
            width, length, rel_tol=MAX_SIZE_DIFFERENCE
        ):
            raise InputError(
                f"{folder / RESULT_FILE}: a pixel is {width:.4g} x {length:.4g} mm, not square; "
                "let 'write_result' write the grid 'metric'"
            )
    return float(size) if MIN_PIXEL_MM <= size <= MAX_PIXEL_MM else None
