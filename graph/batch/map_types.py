"""What the maps in a store are: their types, the names of their dimensions, where pixels lie."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import zarr

MAX_HELD_BYTES = 2**26
"""Bytes of maps that a worker gathers before it writes them; it may hold twice as many."""
MAX_CHUNK_CAPTURES = 32
"""Captures: more are lost at once when a worker dies, and leave others idle at the end."""
AXIS_NAMES = {"H": "y", "W": "x"}
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

    @property
    def nbytes(self) -> int:
        return math.prod(self.shape) * np.dtype(self.dtype).itemsize


def captures_together(types: Iterable[MapType]) -> int:
    """The number of captures to write together: a power of two whose maps a worker can hold."""
    fit = MAX_HELD_BYTES // max(1, sum(kind.nbytes for kind in types))
    return max(1, min(MAX_CHUNK_CAPTURES, 1 << max(0, fit.bit_length() - 1)))


def axes_of(types: Mapping[str, MapType]) -> dict[str, list[str]]:
    """The names of each map's dimensions: one name is one size in all the store."""
    sizes: dict[str, int] = {}
    found: dict[str, list[str]] = {}
    for name, kind in types.items():
        found[name] = []
        for dim, size in zip(kind.dims, kind.shape, strict=True):
            axis = AXIS_NAMES.get(dim, dim)
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
