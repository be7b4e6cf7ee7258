"""Write a height map for other people's tools."""

from pathlib import Path
from typing import Annotated

from annotated_types import MinLen

from tactograph.graph import node
from tactograph.graph.disk.atomic_files import atomic_files
from tactograph.nodes import Height, HeightError, Lens, Metrics, PixelSize, Vergence
from tactograph.nodes.files.height_files import Format, write_height
from tactograph.nodes.files.result_file import RESULT_FILE, write_result_file


@node
def export_height(
    height: Height,
    pixel: PixelSize,
    name: str | None = None,
    lens: Lens | None = None,
    camera: Vergence | None = None,
    error: HeightError | None = None,
    metrics: Metrics | None = None,
    *,
    folder: Path,
    formats: Annotated[tuple[Format, ...], MinLen(1)] = ("tmd", "stl"),
) -> None:
    """Write ``height.EXT`` per format into `folder`, or its subfolder of the touch's name.

    Parameters
    ----------
    height : H x W in mm
    pixel : mm per px
    name : the capture's name in a stream; empty for a single capture
    lens, camera
        Length 8, as `read_lens` gives it, and 1 / D in 1/mm, with D the height of the camera's
        pupil above the film (0: orthographic).  If they are given, the points of meshes are
        where they lie on the film; images stay what each pixel sees.
    error
        H x W in mm, the height's standard deviation; a second layer in "x3p", a second channel
        in "gwy".
    metrics
        Figures of how the height was made, which ``result.json`` then states, with its pixel size.
    folder : created if needed
    formats
        "npy" and "tiff": 32-bit floats in mm.  "png": 16 bit, 0.1 micrometres a level from
        -1 mm, stated in the file.  "tmd": TrueMap's, as GelSight's tools read it.  "sur":
        Digital Surf's, as MountainsMap and Gwyddion read it.  "sdf": ISO 25178-71's, "x3p": ISO
        25178-72's.  "gwy" and "gsf": Gwyddion's.  These five need ``pip install
        'tactograph[metrology]'``.  "ply", "stl" and "obj": a mesh in mm,
        right-handed: x right, y up, z to the camera, from the image's middle on the film at
        rest.  Unknown film (NaN) is NaN in "npy" and
        "tiff", transparent in "png", not measured in "sur" and left out of meshes; "tmd" cannot
        hold it.

    Raises
    ------
    InputError
        If the folder cannot be written, a format cannot hold the height, a library is not
        installed, or the film rises to the camera; then no file of this touch is written.
    """
    place = folder / name if name else folder
    with atomic_files(place, last=RESULT_FILE) as target:
        for extension in formats:
            file = target / f"height.{extension}"
            write_height(file, height, pixel, lens, camera or 0.0, error)
        if metrics is not None:
            about = {"format": 1, "pixel_size_mm": float(pixel), "metrics": metrics}
            write_result_file(target, about)
