"""TrueMap data, version 2.0, as GelSight's tools read it: float32, mm."""

import struct
from pathlib import Path

import numpy as np

from tactograph.sdk import Height, HeightError, HeightFile, InputError

TMD_MAGIC = b"Binary TrueMap Data File v2.0\r\n\0"
TMD_COMMENT = b"Height map in mm     \r\n\0"
"""24 bytes: some readers take the comment to be as long as TrueMap's own."""
TMD_SIZES = struct.Struct("<2i4f")
"""Columns, rows, width and length in mm, offset in x and y in mm."""


def write(file: Path, height: Height, pixel: float, _: HeightError | None = None) -> None:
    """Write heights in mm; the error is left out.

    Raises
    ------
    InputError
        If the film is unknown (NaN) anywhere, for which the format has no sign.
    """
    unknown = np.count_nonzero(np.isnan(height))
    if unknown:
        raise InputError(
            f"{file.name}: the film is unknown (NaN) at {unknown} pixels, which a .tmd file cannot "
            "hold; write tiff, png, npy, sur or a mesh"
        )
    rows, columns = height.shape
    sizes = TMD_SIZES.pack(columns, rows, columns * pixel, rows * pixel, 0.0, 0.0)
    file.write_bytes(TMD_MAGIC + TMD_COMMENT + sizes + height.astype("<f4").tobytes())


def read(file: Path) -> HeightFile:
    """TrueMap data, version 2.0."""
    content = file.read_bytes()
    comment_end = content.find(b"\0", len(TMD_MAGIC))
    if content[:29] != TMD_MAGIC[:29] or comment_end < 0:
        raise InputError(f"{file}: no TMD file of version 2.0")
    start = comment_end + 1 + TMD_SIZES.size
    if len(content) < start:
        raise InputError(f"{file}: ends within its header")
    columns, rows, width, length = TMD_SIZES.unpack_from(content, comment_end + 1)[:4]
    if columns < 1 or rows < 1 or len(content) < start + 4 * columns * rows:
        raise InputError(f"{file}: declares {columns} x {rows} heights, but the file is shorter")
    heights = np.frombuffer(content, "<f4", columns * rows, start)
    height = np.asarray(heights.reshape(rows, columns), np.float32)
    return HeightFile.of(height, width / columns, length / rows)
