"""Height maps in other people's formats: images and meshes; rings bring further ones."""

import json
import math
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import cv2
import numpy as np
from PIL import Image, PngImagePlugin
from PIL.TiffImagePlugin import ImageFileDirectory_v2, TiffImageFile

from tactograph.graph import InputError
from tactograph.graph.errors import missing
from tactograph.graph.rings import bring, brought
from tactograph.nodes import F4, I4, Height, HeightError, Lens
from tactograph.nodes.files.height_picture import (
    OFFSET_MM,
    STEP_MM,
    UNKNOWN_LEVEL,
    height_levels,
    level_height,
)
from tactograph.nodes.files.image_files import read_heights
from tactograph.nodes.files.result_file import refuse_changed
from tactograph.nodes.optics.film_places import film_places

if TYPE_CHECKING:
    Format = str
else:
    Format = Literal[("npy", "tiff", "png", "tmd", "ply", "stl", "obj", *brought("formats"))]
"""The formats of a height map: those written here, and those that rings bring."""

MIN_PIXEL_MM, MAX_PIXEL_MM = 1e-6, 1.0
"""Pixels that sensors of touch have; a size outside is one in another unit, such as um."""
MAX_SIZE_DIFFERENCE = 0.005
"""Relative difference of two lengths of a pixel that counts as a contradiction."""
PNG_TEXT = "Tactograph height"
"""The PNG's text chunk that holds step and offset."""
TIFF_TEXT = "height in mm above the untouched film"
"""The description in the TIFFs written here."""
PER_CM = 3
"""A TIFF's number for a resolution in pixels per centimetre."""
TMD_MAGIC = b"Binary TrueMap Data File v2.0\r\n\0"
TMD_COMMENT = b"Height map in mm     \r\n\0"
"""24 bytes: some readers take the comment to be as long as TrueMap's own."""
TMD_SIZES = struct.Struct("<2i4f")
"""Columns, rows, width and length in mm, offset in x and y in mm."""
MESH_AXES = "mm from the image's middle on the film at rest; x right, y up, z to the camera"
"""Comment in meshes; an STL has room for 80 bytes."""
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

STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])


class HeightFile(NamedTuple):
    """A height map H x W in mm; the side of a pixel in mm and the height's standard deviation in
    mm, None if the file does not say it."""

    height: F4
    pixel: float | None = None
    error: F4 | None = None


class Surface(NamedTuple):
    """A triangle mesh: V x 3 in mm, and F x 3, the vertices' numbers."""

    vertices: F4
    faces: I4


def grid_triangles(rows: int, columns: int) -> I4:
    """Return the numbers of the corners of two triangles between four pixels, T x 3."""
    corner = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)[:-1, :-1].ravel()
    right, below = corner + 1, corner + columns
    halves = [np.stack([corner, below, right], 1), np.stack([right, below, below + 1], 1)]
    return np.concatenate(halves)


def surface_of(
    height: Height, pixel: float, lens: Lens | None = None, camera: float = 0.0
) -> Surface:
    """Return the height map as a mesh, two triangles between four pixels.

    Meshes are right-handed: x right, y up (so the image's rows run towards -y), z to the
    camera.  The origin is the image's middle on the film at rest.  Points lie where they are on
    the film (`film_places`).  What is not known, NaN, is left out.
    """
    rows, columns = height.shape
    x, y = film_places(height, lens, camera)
    vertices = np.stack([x * pixel, -y * pixel, height], axis=-1).reshape(-1, 3)
    faces = grid_triangles(rows, columns)
    is_known = np.isfinite(vertices[:, 2])
    if not is_known.all():
        number = np.cumsum(is_known) - 1
        vertices, faces = vertices[is_known], number[faces[is_known[faces].all(axis=1)]]
    return Surface(vertices.astype(np.float32), faces.astype(np.int32))


def write_tiff(file: Path, height: Height, pixel: float, length: float | None = None) -> None:
    """One 32-bit float channel in mm, a pixel's size, or its width and `length`, as resolution."""
    tags = ImageFileDirectory_v2()
    tags[270] = TIFF_TEXT
    tags[282], tags[283] = 10 / pixel, 10 / (length or pixel)
    tags[296] = PER_CM
    Image.fromarray(np.asarray(height, np.float32)).save(file, tiffinfo=tags)


def write_png(file: Path, height: Height, pixel: float) -> None:
    """16-bit grey: height = offset + level * step, both stated in a text chunk.

    Unknown film, NaN, is transparent by the PNG's tRNS chunk.

    Raises
    ------
    InputError
        If the height does not fit into 16 bits at this scale.
    """
    try:
        grey = height_levels(height)
    except InputError as error:
        raise InputError(f"{file.name}: {error}; write tiff or npy instead") from None
    about = {"unit": "mm", "step": STEP_MM, "offset": OFFSET_MM, "pixel_size_mm": pixel}
    transparent: dict[str, Any] = {}
    if not np.isfinite(height).all():
        about["unknown_level"] = transparent["transparency"] = UNKNOWN_LEVEL
    text = PngImagePlugin.PngInfo()
    text.add_text(PNG_TEXT, json.dumps(about))
    Image.fromarray(grey).save(file, pnginfo=text, **transparent)


def write_tmd(file: Path, height: Height, pixel: float) -> None:
    """TrueMap data, version 2.0, as GelSight's tools read it: float32, mm.

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


def write_height(
    file: Path,
    height: Height,
    pixel: float,
    lens: Lens | None = None,
    camera: float = 0.0,
    error: HeightError | None = None,
) -> None:
    """Write a height map in the format of the file's suffix.

    Raises
    ------
    InputError
        If the format cannot hold it, or its library is not installed.
    """
    extension = file.suffix[1:]
    if extension in MESH_WRITERS:
        write_mesh(file, height, pixel, lens, camera)
    elif extension in HEIGHT_WRITERS:
        HEIGHT_WRITERS[extension](file, height, pixel)
    elif (further := bring("formats", extension)) is not None:
        further.write(file, height, pixel, error)


def write_mesh(
    file: Path, height: Height, pixel: float, lens: Lens | None = None, camera: float = 0.0
) -> None:
    """PLY (binary), STL (binary) or OBJ by the file's suffix."""
    surface = surface_of(height, pixel, lens, camera)
    MESH_WRITERS[file.suffix[1:]](file, surface)


def _write_ply(file: Path, surface: Surface) -> None:
    sizes = {"vertices": len(surface.vertices), "faces": len(surface.faces)}
    header = PLY_HEADER.format(axes=MESH_AXES, **sizes)
    faces = np.empty(len(surface.faces), [("count", "u1"), ("vertices", "<i4", 3)])
    faces["count"], faces["vertices"] = 3, surface.faces
    file.write_bytes(header.encode() + surface.vertices.astype("<f4").tobytes() + faces.tobytes())


def _write_stl(file: Path, surface: Surface) -> None:
    corners = surface.vertices[surface.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    facets = np.zeros(len(corners), STL_FACET)
    facets["normal"] = normals / np.where(lengths > 0, lengths, 1)
    facets["corners"] = corners
    header = MESH_AXES.encode().ljust(80, b"\0") + struct.pack("<I", len(facets))
    file.write_bytes(header + facets.tobytes())


def _write_obj(file: Path, surface: Surface) -> None:
    vertices = "v %.8f %.8f %.8f\n" * len(surface.vertices) % tuple(surface.vertices.flat)
    faces = "f %d %d %d\n" * len(surface.faces) % tuple((surface.faces + 1).flat)
    file.write_text(f"# {MESH_AXES}\n{vertices}{faces}", encoding="ascii")


MESH_WRITERS = {"ply": _write_ply, "stl": _write_stl, "obj": _write_obj}
HEIGHT_WRITERS: Mapping[str, Callable[[Path, Height, float], None]] = {
    "npy": lambda file, height, _: np.save(file, height),
    "tiff": write_tiff,
    "png": write_png,
    "tmd": write_tmd,
}


def read_npy(file: Path) -> HeightFile:
    """A two-dimensional array of numbers, mm."""
    refuse_changed(file)
    return HeightFile(read_heights(file))


def read_tiff(file: Path) -> HeightFile:
    """A single channel of floats, mm."""
    refuse_changed(file)
    image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise InputError(f"{file}: cannot be decoded, the file is damaged or no TIFF")
    if image.ndim != 2 or image.dtype.kind != "f":
        raise InputError(f"{file}: a height map is one channel of 32-bit floats in mm")
    return HeightFile(np.asarray(image, np.float32), _tiff_pixel(file))


def _tiff_pixel(file: Path) -> float | None:
    """The pixel size of a TIFF written here.

    The resolution that another program writes is often that of a printer.
    """
    try:
        with TiffImageFile(str(file)) as image:
            tags = image.tag_v2
            if tags.get(270) != TIFF_TEXT or tags.get(296) != PER_CM:
                return None
            return square_pixel(10 / float(tags[282]), 10 / float(tags[283]))
    except (OSError, SyntaxError, ValueError, KeyError, ZeroDivisionError):
        return None


def read_png(file: Path) -> HeightFile:
    """16-bit grey that states its own scale."""
    try:
        with Image.open(file) as image:
            about = json.loads(image.info[PNG_TEXT])
            levels = np.asarray(image)
        step, offset = float(about["step"]), float(about["offset"])
        side = float(about.get("pixel_size_mm", math.nan))
    except (KeyError, TypeError):
        raise InputError(f"{file}: states no scale, so its grey levels are no heights") from None
    except (OSError, SyntaxError, ValueError, OverflowError) as error:
        raise InputError(f"{file}: cannot be decoded: {error}") from None
    height = level_height(levels, step, offset)
    if "unknown_level" in about:
        height[levels == about["unknown_level"]] = np.nan
    return HeightFile(height, square_pixel(side, side))


def read_tmd(file: Path) -> HeightFile:
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
    return HeightFile(height, square_pixel(width / columns, length / rows))


def square_pixel(width: float, length: float) -> float | None:
    """Return the side of a pixel of this width and length in mm; None if it is no square."""
    is_size = min(width, length) >= MIN_PIXEL_MM and max(width, length) <= MAX_PIXEL_MM
    return width if is_size and math.isclose(width, length, rel_tol=MAX_SIZE_DIFFERENCE) else None


HEIGHT_READERS: Mapping[str, Callable[[Path], HeightFile]] = {
    ".tiff": read_tiff,
    ".tif": read_tiff,
    ".png": read_png,
    ".tmd": read_tmd,
}
"""The formats other than ``.npy``, by suffix."""


def read_height_file(file: Path) -> HeightFile:
    """Read a height map in the format of its suffix; one that is not known is taken for NumPy's.

    Raises
    ------
    InputError
        If the file is missing, damaged or no height map.
    """
    if file.is_dir():
        raise InputError(f"{file}: is a folder; give the height in it")
    if not file.is_file():
        raise InputError(missing(file, "file"))
    suffix = file.suffix.lower()
    if suffix in HEIGHT_READERS:
        return HEIGHT_READERS[suffix](file)
    further = bring("formats", suffix[1:])
    return read_npy(file) if further is None else further.read(file)
