"""Write a height map for other people's tools."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from annotated_types import MinLen

from tactograph.rings.export.nodes._meshes import MESH_WRITERS
from tactograph.sdk import (
    Height,
    HeightError,
    HeightFile,
    InputError,
    PixelSize,
    StoredResult,
    View,
    brought,
    node,
    warn,
)

MESH_FORMATS = ("ply", *MESH_WRITERS)
OWN_FORMATS = ("npy", "tiff", *MESH_FORMATS)
if TYPE_CHECKING:
    Format = str
else:
    Format = Literal[(*OWN_FORMATS, *brought("formats"))]
"""The formats of a height map: those of the core, meshes, and those that rings bring."""


@node
def export_height(
    height: Height,
    pixel: PixelSize,
    name: str | None = None,
    view: View | None = None,
    error: HeightError | None = None,
    metrics: dict[str, float] | None = None,
    rest: Height | None = None,
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
    view
        The camera's lens and the height of its pupil.  If it is given, the points of meshes are
        where they lie on the film; images stay what each pixel sees.
    error
        H x W in mm, the height's standard deviation; a second layer in "x3p", a second channel
        in "gwy".
    metrics
        Figures of how the height was made, which ``result.json`` then states, with its pixel size
        and view.
    rest
        H x W in mm, the height of the film at rest that each pixel sees; None: a plane.  Meshes
        then are the film's own shape; images stay the height above it.
    folder : created if needed
    formats
        "npy" and "tiff": 32-bit floats in mm.  "png": 16 bit, 0.1 micrometres a level from
        -1 mm, stated in the file.  "tmd": TrueMap's, as GelSight's tools read it.  "sur":
        Digital Surf's, as MountainsMap and Gwyddion read it.  "sdf": ISO 25178-71's, "x3p": ISO
        25178-72's.  "gwy": Gwyddion's.  These four need ``pip install
        'tactograph[metrology]'``.  "ply", "stl" and "obj": a mesh in mm,
        right-handed: x right, y up, z to the camera, from the image's middle on the film at
        rest.  Unknown film (NaN) is NaN in "npy" and
        "tiff", transparent in "png", not measured in "sur" and left out of meshes; "tmd" cannot
        hold it.

    Raises
    ------
    InputError
        If the folder cannot be written or is called like a file, a format cannot hold the height,
        a library is not installed, or the film rises to the camera; then no file of this touch is
        written.
    """
    known = (*OWN_FORMATS, *brought("formats"))
    if (ending := folder.suffix[1:]) in known:
        raise InputError(
            f"`folder`={folder}: is to be a folder; `formats`={ending} writes height.{ending} there"
        )
    # As .xyz or .step ends a file's name; a new folder is hardly called so.
    if re.fullmatch("[a-z]{3,4}", ending) and not folder.exists():
        raise InputError(
            f"`folder`={folder}: no format is called {ending}; `formats` may be any of "
            f"{', '.join(known)}. Make this folder first if its name is to end so"
        )
    view = view or View()
    film = height if rest is None else height + rest
    images = [f"height.{extension}" for extension in formats if extension not in MESH_FORMATS]
    if images and not view.is_plain:
        even, apparent = View().places(film), view.places(film)
        apart_mm = pixel * np.nanmax(np.hypot(*np.subtract(apparent, even)))
        warn(
            f"{', '.join(images)}: what the camera's pixels see, by a lens or from near, is up to "
            f"{apart_mm:.2g} mm from where an even grid has it; meshes are true, and so are "
            "results made with --set save.grid=metric"
        )
    place = folder / name if name else folder
    about = {"format": 1, "pixel_size_mm": float(pixel), "metrics": metrics or {}, **view.stated()}
    is_result = metrics is not None or not view.is_plain
    with StoredResult.new_files(place, about if is_result else None) as target:
        for extension in formats:
            file = target / f"height.{extension}"
            if extension in MESH_WRITERS:
                MESH_WRITERS[extension](file, *view.mesh(film, pixel))
            else:
                exported = film if extension in MESH_FORMATS else height
                HeightFile(exported, pixel, error).write(file, view)
