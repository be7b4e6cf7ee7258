"""Any mesh file, laid on the plane and seen from above."""

from pathlib import Path
from typing import Literal

import numpy as np

from tactograph.graph import InputError, node
from tactograph.graph.extras import need
from tactograph.nodes import F8
from tactograph.nodes.optics.shape import Length, Shape, ShapeImage, shape, turned

Up = Literal["flat", "x", "-x", "y", "-y", "z", "-z"]
PAIRS_AT_ONCE = 1 << 21
"""Pairs of a triangle and a pixel that are processed at once; this bounds the memory."""


@node
def shape_mesh(
    *,
    file: Path,
    length_mm: Length | None = None,
    up: Up = "flat",
    rise_mm: Length | None = None,
    angle_deg: float = 0.0,
    image: ShapeImage,
) -> Shape:
    """Return the height of a mesh that lies on the plane.

    Parameters
    ----------
    file
        Any format that trimesh reads: STL, PLY, OBJ, OFF, GLB, ...
        (``pip install 'tactograph[mesh]'``).
    length_mm : longest horizontal extent after scaling; by default one unit of the file is 1 mm
    up
        The mesh's axis that points to the camera; "flat" lays the mesh on its flattest side,
        with its longest axis along x.
    rise_mm
        Height of the highest point above the plane; what lies lower is sunk into the plane.
        By default the mesh lies on the plane.
    angle_deg : turns the mesh from x (right) towards y (down)

    Raises
    ------
    InputError
        If the file cannot be read or holds no triangles, or trimesh is not installed.
    """
    image.check_pixels()
    vertices, triangles = _read(file)
    vertices = _laid_down(vertices, up)
    if length_mm is not None:
        vertices = vertices * (length_mm / np.ptp(vertices[:, :2], axis=0).max())
    top = vertices[:, 2].max()
    base = vertices[:, 2].min() if rise_mm is None else top - rise_mm
    x, y = turned(vertices[:, 0], vertices[:, 1], -angle_deg)
    columns = (x + image.offset_mm[0]) / image.pixel_size_mm + (image.width_px - 1) / 2
    rows = (y + image.offset_mm[1]) / image.pixel_size_mm + (image.height_px - 1) / 2
    corners = np.stack([columns, rows, vertices[:, 2] - base], axis=1)[triangles]
    return shape(_rasterised(corners, image.height_px, image.width_px), image.pixel_size_mm)


def _read(file: Path) -> tuple[F8, np.ndarray]:
    need("mesh", "shape_mesh", "trimesh")
    # trimesh takes long to load; only this node needs it.
    import trimesh

    if not file.is_file():
        raise InputError(f"there is no file {file}; give a mesh")
    try:
        mesh = trimesh.load_mesh(file)
    except Exception as error:
        # trimesh's readers raise whatever their parsers raise.
        raise InputError(f"{file} is no mesh that trimesh can read: {error}") from None
    triangles = np.asarray(getattr(mesh, "faces", ()))
    if triangles.size == 0:
        raise InputError(f"{file} holds no triangles; give a surface mesh")
    used, triangles_used = np.unique(triangles, return_inverse=True)
    return np.asarray(mesh.vertices, float)[used], triangles_used.reshape(triangles.shape)


def _laid_down(vertices: F8, up: Up) -> F8:
    """Return the vertices with x right, y down and z towards the camera."""
    if up == "flat":
        # Principal axes: the longest becomes x, the shortest z.
        _, _, axes = np.linalg.svd(vertices - vertices.mean(0), full_matrices=False)
        right, towards = (axis * np.sign(axis[np.abs(axis).argmax()]) for axis in axes[::2])
    else:
        axis = "xyz".index(up[-1])
        right = np.eye(3)[(axis + 1) % 3]
        towards = np.eye(3)[axis] * (-1 if up[0] == "-" else 1)
    # Right, down, towards the camera is a left-handed frame; the mesh must not be mirrored.
    laid = vertices @ np.stack([right, np.cross(right, towards), towards], axis=1)
    return np.asarray(laid - (laid.min(0) + laid.max(0)) / 2)


def _rasterised(corners: F8, rows: int, columns: int) -> F8:
    """Return the highest point above each pixel's centre; corners T x 3 x (column, row, z)."""
    # Triangles seen edge-on cover nothing.
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    corners = corners[np.abs(_cross(b - a, c - a)) > 0]
    height = np.zeros(rows * columns)
    low = np.clip(np.ceil(corners[:, :, :2].min(1)), 0, (columns, rows)).astype(np.int64)
    high = np.clip(np.floor(corners[:, :, :2].max(1)), -1, (columns - 1, rows - 1)).astype(np.int64)
    box = np.maximum(high - low + 1, 0)
    pairs = box[:, 0] * box[:, 1]
    ends = np.cumsum(pairs)
    first = 0
    while first < len(corners):
        begun = ends[first] - pairs[first]
        last = max(int(np.searchsorted(ends, begun + PAIRS_AT_ONCE, side="right")), first + 1)
        part = slice(first, last)
        _raise_to(height, corners[part], low[part], box[part, 0], pairs[part], columns)
        first = last
    return height.reshape(rows, columns)


def _raise_to(
    height: F8, corners: F8, low: np.ndarray, wide: np.ndarray, pairs: np.ndarray, columns: int
) -> None:
    """Raise the pixels inside each triangle to its height, by barycentric interpolation."""
    triangle = np.repeat(np.arange(len(corners)), pairs)
    nth = np.arange(len(triangle)) - np.repeat(np.cumsum(pairs) - pairs, pairs)
    column = low[triangle, 0] + nth % wide[triangle]
    row = low[triangle, 1] + nth // wide[triangle]
    a, b, c = (corners[triangle, i] for i in range(3))
    area = _cross(b - a, c - a)
    at = np.stack([column, row], axis=1)
    u, v = _cross(b[:, :2] - at, c[:, :2] - at), _cross(c[:, :2] - at, a[:, :2] - at)
    u, v = u / area, v / area
    inside = (u >= 0) & (v >= 0) & (u + v <= 1)
    z = u * a[:, 2] + v * b[:, 2] + (1 - u - v) * c[:, 2]
    np.maximum.at(height, (row * columns + column)[inside], z[inside])


def _cross(a: F8, b: F8) -> F8:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
