"""Meshes of height maps that other programs read."""

import struct
from pathlib import Path

import numpy as np

from tactograph.sdk.unstable import Surface

STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])


def write_stl(file: Path, surface: Surface) -> None:
    """Write a binary STL: corners and normal of each triangle."""
    corners = surface.vertices[surface.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    facets = np.zeros(len(corners), STL_FACET)
    facets["normal"] = normals / np.where(lengths > 0, lengths, 1)
    facets["corners"] = corners
    header = surface.axes.encode().ljust(80, b"\0") + struct.pack("<I", len(facets))
    file.write_bytes(header + facets.tobytes())


def write_obj(file: Path, surface: Surface) -> None:
    """Write an OBJ: vertices, and their numbers from 1."""
    vertices = "v %.8f %.8f %.8f\n" * len(surface.vertices) % tuple(surface.vertices.flat)
    faces = "f %d %d %d\n" * len(surface.faces) % tuple((surface.faces + 1).flat)
    file.write_text(f"# {surface.axes}\n{vertices}{faces}", encoding="ascii")


MESH_WRITERS = {"stl": write_stl, "obj": write_obj}
