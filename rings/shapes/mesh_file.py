"""Triangle meshes of others, and their height seen from above."""

from pathlib import Path

import numpy as np

from tactograph.sdk import F8, InputError, need

PAIRS_AT_ONCE = 1 << 21
"""Pairs of a triangle and a pixel that are processed at once; this bounds the memory."""

EDGE_TOLERANCE = 1e-9
"""How far, as a share of a triangle's side, a point beside it counts as inside."""


def read_mesh(file: Path, reader: str) -> tuple[F8, np.ndarray]:
    """Return vertices V x 3 and triangles F x 3 of any format that trimesh reads.

    Raises
    ------
    InputError
        If the file cannot be read or holds no triangles, or trimesh is not installed.
    """
    need("mesh", reader, "trimesh")
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


def rasterised(corners: F8, rows: int, columns: int) -> F8:
    """Return the highest point above each pixel's centre, 0 where there is none above 0.

    Corners are T x 3 x (column, row, z).
    """
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
        before = ends[first] - pairs[first]
        last = max(int(np.searchsorted(ends, before + PAIRS_AT_ONCE, side="right")), first + 1)
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
    # A centre on an edge of two triangles is in one of them, however numbers round.
    inside = (u >= -EDGE_TOLERANCE) & (v >= -EDGE_TOLERANCE) & (u + v <= 1 + EDGE_TOLERANCE)
    z = u * a[:, 2] + v * b[:, 2] + (1 - u - v) * c[:, 2]
    np.maximum.at(height, (row * columns + column)[inside], z[inside])


def _cross(a: F8, b: F8) -> F8:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
