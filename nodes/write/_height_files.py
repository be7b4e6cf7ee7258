"""Height maps in other people's formats: images, meshes, and those of surface metrology."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal, NamedTuple

import cv2
import numpy as np
from PIL import Image, PngImagePlugin
from PIL.TiffImagePlugin import ImageFileDirectory_v2

from tactograph.graph import InputError
from tactograph.nodes import F4, I4, Height, Lens
from tactograph.nodes.capture._image_files import MOST_PIXELS
from tactograph.nodes.contact._areal_surface import UM, areal_surface, surfalize
from tactograph.nodes.write._film_places import film_places

Format = Literal["npy", "tiff", "png", "tmd", "sur", "ply", "stl", "obj"]

STEP_MM = 1e-4
"""A level of a 16-bit PNG: 0.1 micrometres."""
OFFSET_MM = -1.0
"""The height of its level 0; level 65535 is 5.5535 mm."""
PNG_TEXT = "Tactograph height"
"""The PNG's text chunk that holds step and offset."""
TMD_MAGIC = b"Binary TrueMap Data File v2.0\r\n\0"
TMD_COMMENT = b"Height map in mm     \r\n\0"
"""24 bytes: some readers take the comment to be as long as TrueMap's own."""
SUR_SIZES_AT, SUR_SIZES = 108, struct.Struct("<2i")
"""Where a .sur file says its columns and rows."""
TMD_SIZES = struct.Struct("<2i4f")
"""Columns, rows, width and length in mm, offset in x and y in mm."""


PLY_HEADER = """\
ply
format binary_little_endian 1.0
comment heights in mm
element vertex {vertices}
property float x
property float y
property float z
element face {faces}
property list uchar int vertex_indices
end_header
"""


class Surface(NamedTuple):
    """A triangle mesh: V x 3 in mm, and F x 3, the vertices' numbers."""

    vertices: F4
    faces: I4


def surface_of(
    height: Height, pixel: float, lens: Lens | None = None, camera: float = 0.0
) -> Surface:
    """Return the height map as a mesh, two triangles between four pixels.

    Meshes are right-handed: x right, y up (so the image's rows run towards -y), z to the
    camera.  Points lie where they are on the film (`film_places`).  What is not known, NaN, is
    left out.
    """
    rows, columns = height.shape
    x, y = film_places(height, lens, camera)
    vertices = np.stack([x * pixel, -y * pixel, height], axis=-1).reshape(-1, 3)
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    right, below = corner + 1, corner + columns
    faces = np.concatenate(
        [np.stack([corner, below, right], 1), np.stack([right, below, below + 1], 1)]
    )
    known = np.isfinite(vertices[:, 2])
    if not known.all():
        number = np.cumsum(known) - 1
        vertices, faces = vertices[known], number[faces[known[faces].all(axis=1)]]
    return Surface(vertices.astype(np.float32), faces.astype(np.int32))


def write_npy(file: Path, height: Height, pixel: float) -> None:
    """NumPy's own: float32, H x W, mm."""
    np.save(file, height)


def write_tiff(file: Path, height: Height, pixel: float) -> None:
    """One 32-bit float channel in mm, the pixel size as its resolution."""
    tags = ImageFileDirectory_v2()
    tags[270] = "height in mm above the untouched film"
    tags[282] = tags[283] = 10 / pixel
    tags[296] = 3  # pixels per centimetre
    Image.fromarray(np.asarray(height, np.float32)).save(file, tiffinfo=tags)


def write_png(file: Path, height: Height, pixel: float) -> None:
    """16-bit grey: height = offset + level * step, both stated in a text chunk.

    Raises
    ------
    InputError
        If the height does not fit into 16 bits at this scale.
    """
    levels = np.rint((height.astype(np.float64) - OFFSET_MM) / STEP_MM)
    if levels.min() < 0 or levels.max() > 65535:
        raise InputError(
            f"{file.name}: heights from {height.min():.2f} to {height.max():.2f} mm do not fit "
            f"into {OFFSET_MM} to {OFFSET_MM + 65535 * STEP_MM:.2f} mm; write tiff or npy instead"
        )
    text = PngImagePlugin.PngInfo()
    about = {"unit": "mm", "step": STEP_MM, "offset": OFFSET_MM, "pixel_size_mm": pixel}
    text.add_text(PNG_TEXT, json.dumps(about))
    Image.fromarray(levels.astype(np.uint16)).save(file, pnginfo=text)


def write_tmd(file: Path, height: Height, pixel: float) -> None:
    """TrueMap data, version 2.0, as GelSight's tools read it: float32, mm."""
    rows, columns = height.shape
    sizes = TMD_SIZES.pack(columns, rows, columns * pixel, rows * pixel, 0.0, 0.0)
    file.write_bytes(TMD_MAGIC + TMD_COMMENT + sizes + height.astype("<f4").tobytes())


def write_sur(file: Path, height: Height, pixel: float) -> None:
    """Digital Surf's format, which MountainsMap and Gwyddion read: 32-bit steps; NaN: unknown.

    Raises
    ------
    InputError
        If surfalize is not installed, or all heights are the same: the file's steps share the
        range of the heights out.
    """
    # Before anything is known of the heights: without the library they do not matter.
    surfalize()
    known = height[np.isfinite(height)]
    if not known.size or known.min() == known.max():
        raise InputError(
            f"{file.name}: all heights are the same, which a .sur file cannot hold; write tmd or "
            "tiff"
        )
    surface = areal_surface(np.where(np.isfinite(height), height, np.nan), pixel)
    # The format is older than UTF-8: its unit is a micro sign of one byte.
    surface.save(str(file), encoding="latin-1")


def write_mesh(
    file: Path, height: Height, pixel: float, lens: Lens | None = None, camera: float = 0.0
) -> None:
    """PLY (binary), STL (binary) or OBJ by the file's suffix."""
    surface = surface_of(height, pixel, lens, camera)
    if file.suffix == ".ply":
        _write_ply(file, surface)
        return
    # It loads longer than a touch takes to compute.
    import trimesh

    trimesh.Trimesh(*surface, process=False).export(file)


def _write_ply(file: Path, surface: Surface) -> None:
    header = PLY_HEADER.format(vertices=len(surface.vertices), faces=len(surface.faces))
    faces = np.empty(len(surface.faces), [("count", "u1"), ("vertices", "<i4", 3)])
    faces["count"], faces["vertices"] = 3, surface.faces
    file.write_bytes(header.encode() + surface.vertices.astype("<f4").tobytes() + faces.tobytes())


MESHES = ("ply", "stl", "obj")
WRITERS: Mapping[str, Callable[[Path, Height, float], None]] = {
    "npy": write_npy,
    "tiff": write_tiff,
    "png": write_png,
    "tmd": write_tmd,
    "sur": write_sur,
}


def read_tiff(file: Path) -> F4:
    """A single channel of floats, mm."""
    image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise InputError(f"{file}: cannot be decoded, the file is damaged or no TIFF")
    if image.ndim != 2 or image.dtype.kind != "f":
        raise InputError(f"{file}: a height map is one channel of 32-bit floats in mm")
    return np.asarray(image, np.float32)


def read_png(file: Path) -> F4:
    """16-bit grey that states its own scale."""
    try:
        with Image.open(file) as image:
            about = json.loads(image.info[PNG_TEXT])
            levels = np.asarray(image)
        step, offset = float(about["step"]), float(about["offset"])
    except (KeyError, TypeError):
        raise InputError(f"{file}: states no scale, so its grey levels are no heights") from None
    except (OSError, SyntaxError, ValueError) as error:
        raise InputError(f"{file}: cannot be decoded: {error}") from None
    return np.asarray(offset + step * levels.astype(np.float64), np.float32)


def read_tmd(file: Path) -> F4:
    """TrueMap data, version 2.0."""
    content = file.read_bytes()
    comment_end = content.find(b"\0", len(TMD_MAGIC))
    if content[:29] != TMD_MAGIC[:29] or comment_end < 0:
        raise InputError(f"{file}: no TMD file of version 2.0")
    start = comment_end + 1 + TMD_SIZES.size
    if len(content) < start:
        raise InputError(f"{file}: ends within its header")
    columns, rows = TMD_SIZES.unpack_from(content, comment_end + 1)[:2]
    if columns < 1 or rows < 1 or len(content) < start + 4 * columns * rows:
        raise InputError(f"{file}: declares {columns} x {rows} heights, but the file is shorter")
    heights = np.frombuffer(content, "<f4", columns * rows, start)
    return np.asarray(heights.reshape(rows, columns), np.float32)


def read_sur(file: Path) -> F4:
    """Digital Surf's format; what was not measured is NaN."""
    load = surfalize().Surface.load
    with file.open("rb") as opened:
        header = opened.read(SUR_SIZES_AT + SUR_SIZES.size)
    if len(header) < SUR_SIZES_AT + SUR_SIZES.size:
        raise InputError(f"{file}: ends within its header")
    columns, rows = SUR_SIZES.unpack_from(header, SUR_SIZES_AT)
    if min(columns, rows) < 1 or columns * rows > MOST_PIXELS:
        raise InputError(f"{file}: says {columns} x {rows} heights, which no sensor has")
    try:
        surface = load(str(file))
    # A file that is damaged fails in whichever way its bytes make it fail.
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{file}: cannot be read as a .sur file: {reason}") from None
    return np.asarray(surface.data / UM, np.float32)


READERS: Mapping[str, Callable[[Path], F4]] = {
    ".tiff": read_tiff,
    ".tif": read_tiff,
    ".png": read_png,
    ".tmd": read_tmd,
    ".sur": read_sur,
}
