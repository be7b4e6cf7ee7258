"""Any mesh file, laid on the plane and seen from above."""

from pathlib import Path
from typing import Literal

import numpy as np

from tactograph.rings.shapes.mesh_file import rasterised, read_mesh
from tactograph.sdk import F8, Length, Shape, ShapeImage, node

Up = Literal["flat", "x", "-x", "y", "-y", "z", "-z"]


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
    vertices, triangles = read_mesh(file, "shape_mesh")
    vertices = _laid_down(vertices, up)
    if length_mm is not None:
        vertices = vertices * (length_mm / np.ptp(vertices[:, :2], axis=0).max())
    top = vertices[:, 2].max()
    base = vertices[:, 2].min() if rise_mm is None else top - rise_mm
    place = (vertices[:, 0] + 1j * vertices[:, 1]) * np.exp(1j * np.deg2rad(angle_deg))
    columns = (place.real + image.offset_mm[0]) / image.pixel_size_mm + (image.width_px - 1) / 2
    rows = (place.imag + image.offset_mm[1]) / image.pixel_size_mm + (image.height_px - 1) / 2
    corners = np.stack([columns, rows, vertices[:, 2] - base], axis=1)[triangles]
    return Shape.of(rasterised(corners, image.height_px, image.width_px), image.pixel_size_mm)


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
