"""Read the height maps of many touches: the results of a stream."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from tactograph.graph import InputError, Port, node
from tactograph.nodes import F4, PixelSize
from tactograph.nodes.files.height_files import MAX_SIZE_DIFFERENCE
from tactograph.nodes.files.image_files import check_heights, read_heights
from tactograph.nodes.files.result_file import RESULT_FILE, refuse_changed
from tactograph.nodes.write.read_pixel_size import read_pixel_size

TouchHeights = Annotated[F4, Port("P H W", "mm", nan=True)]
"""Heights of P touches; NaN where not known."""
MAX_TOUCHES = 255


class Touches(NamedTuple):
    """Heights and their standard deviations, NaN where none is stated, and the folders' names."""

    heights: TouchHeights
    errors: TouchHeights
    pixel: PixelSize
    names: list[str]


@node
def read_touches(*, folder: Path) -> Touches:
    """Read every result below `folder`: ``height.npy``, and ``error.npy`` where there is one.

    Parameters
    ----------
    folder
        Holds one folder per result, as `write_result` leaves them.

    Raises
    ------
    InputError
        If there are not 2 to 255 results, or they differ in size or pixel size.
    """
    if (folder / RESULT_FILE).is_file():
        raise InputError(f"{folder}: is one result; give the folder that holds those of a stream")
    results = sorted(file.parent for file in folder.glob(f"*/{RESULT_FILE}"))
    if not 2 <= len(results) <= MAX_TOUCHES:
        raise InputError(
            f"{folder}: holds {len(results)} results, and 2 to {MAX_TOUCHES} are needed; give a "
            "folder that 'tactograph run reconstruct' wrote for a stream"
        )
    heights = [_read(result / "height.npy") for result in results]
    pixels = [read_pixel_size(height=result / "height.npy") for result in results]
    for result, height, pixel in zip(results, heights, pixels, strict=True):
        if height.shape != heights[0].shape or abs(pixel / pixels[0] - 1) > MAX_SIZE_DIFFERENCE:
            raise InputError(f"{result}: differs in size or pixel size from {results[0]}")
    errors = [
        _read(result / "error.npy") if (result / "error.npy").exists() else np.full_like(h, np.nan)
        for result, h in zip(results, heights, strict=True)
    ]
    names = [result.name for result in results]
    return Touches(np.stack(heights), np.stack(errors), pixels[0], names)


def _read(file: Path) -> F4:
    if not file.is_file():
        raise InputError(f"{file}: there is no such file")
    refuse_changed(file)
    plane = read_heights(file)
    check_heights(plane, file, unknown=True)
    return plane
