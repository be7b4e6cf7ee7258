"""Meshes of height maps that other programs read."""

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tactograph.sdk import F4

STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])


def write_stl(file: Path, vertices: F4, faces: NDArray[np.int32], axes: str) -> None:
    """Write a binary STL: corners and normal of each triangle."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    facets = np.zeros(len(corners), STL_FACET)
    facets["normal"] = normals / np.where(lengths > 0, lengths, 1)
    facets["corners"] = corners
    header = axes.encode().ljust(80, b"\0") + struct.pack("<I", len(facets))
    file.write_bytes(header + facets.tobytes())


def write_obj(file: Path, vertices: F4, faces: NDArray[np.int32], axes: str) -> None:
    """Write an OBJ: vertices, and their numbers from 1."""
    places = "v %.8f %.8f %.8f\n" * len(vertices) % tuple(vertices.flat)
    triangles = "f %d %d %d\n" * len(faces) % tuple((faces + 1).flat)
    file.write_text(f"# {axes}\n{places}{triangles}", encoding="ascii")


MESH_WRITERS = {"stl": write_stl, "obj": write_obj}
