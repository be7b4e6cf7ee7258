"""Height maps as NumPy's files, TIFFs and meshes; rings bring further formats."""

import math
from pathlib import Path
from typing import NamedTuple, Self

import cv2
import numpy as np
from PIL import Image
from PIL.TiffImagePlugin import ImageFileDirectory_v2, TiffImageFile

from tactograph.graph import InputError
from tactograph.graph.errors import missing
from tactograph.graph.rings import bring
from tactograph.nodes import F4, MAX_PIXEL_MM, MIN_PIXEL_MM, Height
from tactograph.nodes.files.image_files import check_heights, read_heights
from tactograph.nodes.files.result_file import refuse_changed
from tactograph.nodes.optics.camera_view import View

MAX_SIZE_DIFFERENCE = 0.005
"""Relative difference of two lengths of a pixel that counts as a contradiction."""
TIFF_TEXT = "height in mm above the untouched film"
"""The description in the TIFFs written here."""
PER_CM = 3
"""A TIFF's number for a resolution in pixels per centimetre."""
PLAIN_VIEW = View()
PLY_HEADER = """\
ply
format binary_little_endian 1.0
comment {axes}
element vertex {vertices}
property float x
property float y
property float z
element face {faces}
property list uchar int vertex_indices
end_header
"""


class HeightFile(NamedTuple):
    """A height map H x W in mm; the side of a pixel in mm and the height's standard deviation in
    mm, None if the file does not say it."""

    height: F4
    pixel: float | None = None
    error: F4 | None = None

    @classmethod
    def of(cls, height: F4, width: float, length: float, error: F4 | None = None) -> Self:
        """Return a height whose pixels have this width and length in mm.

        Their size is not stated if they are no squares, or none that sensors of touch have.
        """
        is_size = min(width, length) >= MIN_PIXEL_MM and max(width, length) <= MAX_PIXEL_MM
        is_stated = is_size and cls.agree(width, length)
        return cls(height, width if is_stated else None, error)

    @classmethod
    def read(cls, file: Path) -> "HeightFile":
        """Read a height map in the format of its suffix; an unknown one is taken for NumPy's.

        Raises
        ------
        InputError
            If the file is missing, damaged or no height map.
        """
        if file.is_dir():
            height = file / "height.npy"
            which = f"{height}" if height.is_file() else "the height in it"
            raise InputError(f"{file}: is a folder; give {which}")
        if not file.is_file():
            raise InputError(missing(file, "file"))
        suffix = file.suffix.lower()
        if (further := bring("formats", suffix[1:])) is not None:
            found: HeightFile = further.read(file)
            return found
        refuse_changed(file)
        return _read_tiff(file) if suffix in (".tif", ".tiff") else HeightFile(read_heights(file))

    def write(self, file: Path, view: View = PLAIN_VIEW) -> None:
        """Write it in the format of the file's suffix; a mesh as the camera of `view` sees it.

        Raises
        ------
        InputError
            If the format does not hold such heights, or is not known.
        """
        suffix = file.suffix.lower()
        if suffix == ".npy":
            np.save(file, self.height)
            return
        further = bring("formats", suffix[1:])
        if self.pixel is None or (further is None and suffix not in (".tif", ".tiff", ".ply")):
            raise InputError(f"{file}: heights of unknown pixel size, or format, are not written")
        if further is not None:
            further.write(file, self.height, self.pixel, self.error)
        elif suffix == ".ply":
            write_ply(file, self.height, self.pixel, view)
        else:
            write_tiff(file, self.height, self.pixel)

    @staticmethod
    def agree(one: float, other: float) -> bool:
        """Return whether two lengths of a pixel do not contradict each other."""
        return math.isclose(one, other, rel_tol=MAX_SIZE_DIFFERENCE)

    def checked(self, file: Path, *, unknown: bool = False) -> Self:
        """Return it, unless its height is none in mm; with `unknown` a part may be NaN.

        Raises
        ------
        InputError
            That names `file`, and says what is wrong.
        """
        check_heights(self.height, file, unknown=unknown)
        return self


def write_tiff(file: Path, height: Height, pixel: float, length: float | None = None) -> None:
    """One 32-bit float channel in mm, a pixel's size, or its width and `length`, as resolution."""
    tags = ImageFileDirectory_v2()
    tags[270] = TIFF_TEXT
    tags[282], tags[283] = 10 / pixel, 10 / (length or pixel)
    tags[296] = PER_CM
    Image.fromarray(np.asarray(height, np.float32)).save(file, tiffinfo=tags)


def write_ply(file: Path, height: Height, pixel: float, view: View = PLAIN_VIEW) -> None:
    """Write the mesh of a height map (`View.mesh`), binary."""
    mesh = view.mesh(height, pixel)
    header = PLY_HEADER.format(axes=mesh.axes, vertices=len(mesh.vertices), faces=len(mesh.faces))
    faces = np.empty(len(mesh.faces), [("count", "u1"), ("vertices", "<i4", 3)])
    faces["count"], faces["vertices"] = 3, mesh.faces
    file.write_bytes(header.encode() + mesh.vertices.astype("<f4").tobytes() + faces.tobytes())


def _read_tiff(file: Path) -> HeightFile:
    """A single channel of floats, mm."""
    image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise InputError(f"{file}: cannot be decoded, the file is damaged or no TIFF")
    if image.ndim != 2 or image.dtype.kind != "f":
        raise InputError(f"{file}: a height map is one channel of 32-bit floats in mm")
    return HeightFile.of(np.asarray(image, np.float32), *_tiff_sides(file))


def _tiff_sides(file: Path) -> tuple[float, float]:
    """Width and length in mm of a pixel of a TIFF written here, else NaN.

    The resolution that another program writes is often that of a printer.
    """
    try:
        with TiffImageFile(str(file)) as image:
            tags = image.tag_v2
            if tags.get(270) != TIFF_TEXT or tags.get(296) != PER_CM:
                return math.nan, math.nan
            return 10 / float(tags[282]), 10 / float(tags[283])
    except (OSError, SyntaxError, ValueError, KeyError, ZeroDivisionError):
        return math.nan, math.nan
