"""What the maps in a store are: their types, the names of their dimensions, where pixels lie."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import zarr

AXES = {"H": "y", "W": "x"}
"""An image's dimensions, and what they are called outside: y runs down, x to the right."""


@dataclass(frozen=True)
class MapType:
    """Shape, element type and unit of one of the graph's outputs.

    `pixel` is the mm from pixel to pixel, where the graph says.
    """

    shape: tuple[int, ...]
    dtype: str
    unit: str
    dims: tuple[str, ...]
    pixel: float | None = None


def axes_of(types: Mapping[str, MapType]) -> dict[str, list[str]]:
    """The names of each map's dimensions: one name is one size in all the store."""
    sizes: dict[str, int] = {}
    found: dict[str, list[str]] = {}
    for name, kind in types.items():
        found[name] = []
        for dim, size in zip(kind.dims, kind.shape, strict=True):
            axis = AXES.get(dim, dim)
            if sizes.setdefault(axis, size) != size or axis in types:
                axis = f"{name}_{axis}"
            found[name].append(axis)
    return found


def add_places(group: zarr.Group, axis: str, size: int, pixel: float) -> None:
    """Add where an axis' pixels lie, in mm from the middle of the image, to a store."""
    direction = "right" if axis == "x" else "down"
    array = group.create_array(
        axis,
        shape=(size,),
        dtype="float64",
        dimension_names=(axis,),
        attributes={
            "unit": "mm",
            "units": "mm",
            "long_name": f"{axis} ({direction}, from the middle of the image)",
        },
    )
    array[:] = pixel * np.arange(0.5 - size / 2, size / 2)
