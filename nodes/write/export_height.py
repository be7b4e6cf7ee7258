"""Write a height map for other people's tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from annotated_types import MinLen

from tactograph.graph import node
from tactograph.graph.files.whole_files import whole_files
from tactograph.nodes import Height, PixelSize
from tactograph.nodes.write._height_files import WRITERS, Format


@node
def export_height(
    height: Height,
    pixel: PixelSize,
    name: str | None = None,
    *,
    folder: Path,
    formats: Annotated[tuple[Format, ...], MinLen(1)] = ("tmd", "stl"),
) -> None:
    """Write ``height.EXT`` into `folder`, or a folder of the touch's name inside, per format.

    Parameters
    ----------
    height
        H x W in mm.
    pixel
        mm per px.
    name
        The capture's name in a stream; empty for a single capture.
    folder
        Made if needed.
    formats
        "npy" and "tiff": 32-bit floats in mm.  "png": 16 bit, 0.1 micrometres a level from
        -1 mm, stated in the file.  "tmd": TrueMap's, as GelSight's tools read it.  "ply",
        "stl" and "obj": a mesh in mm, right-handed: x right, y up, z to the camera.

    Raises
    ------
    InputError
        If the folder cannot be written, or the height does not fit into a PNG; then no
        file of this touch is.
    """
    with whole_files(folder / name if name else folder) as target:
        for extension in formats:
            WRITERS[extension](target / f"height.{extension}", height, pixel)
