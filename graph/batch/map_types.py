"""The maps in a store: their types, the names of their dimensions, the places of pixels."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import zarr

MAX_BUFFERED_BYTES = 2**26
"""Bytes of maps that a worker gathers before it writes them; it may hold twice as many."""
MAX_CHUNK_CAPTURES = 32
"""Captures of a chunk: with more, a dead worker loses more, and others idle at the end."""
COMPRESSED_BYTES = 2**21
"""Bytes that are compressed and read as one piece: Zarr takes as long for fewer."""
AXIS_NAMES = {"H": "y", "W": "x"}
"""The names of an image's dimensions in a store: y runs down, x to the right."""


@dataclass(frozen=True)
class MapType:
    """Shape, element type and unit of one of the graph's outputs.

    `pixel` is the pixel size in mm, where the graph states it.
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
    fit = MAX_BUFFERED_BYTES // max(1, sum(kind.nbytes for kind in types))
    return max(1, min(MAX_CHUNK_CAPTURES, 1 << max(0, fit.bit_length() - 1)))


def captures_in_one(kind: MapType, chunk: int) -> int:
    """The number of maps that are compressed as one piece; it divides the shard."""
    nbytes = max(1, kind.nbytes)
    return max(
        n
        for n in range(1, chunk + 1)
        if chunk % n == 0 and (n == 1 or n * nbytes <= COMPRESSED_BYTES)
    )


def axes_of(types: Mapping[str, MapType]) -> dict[str, list[str]]:
    """The names of each map's dimensions; a name stands for one size in the whole store."""
    sizes: dict[str, int] = {}
    axes: dict[str, list[str]] = {}
    for name, kind in types.items():
        axes[name] = []
        for dim, size in zip(kind.dims, kind.shape, strict=True):
            axis = AXIS_NAMES.get(dim, dim)
            if sizes.setdefault(axis, size) != size or axis in types:
                axis = f"{name}_{axis}"
            axes[name].append(axis)
    return axes


def add_places(group: zarr.Group, axis: str, size: int, pixel: float) -> None:
    """Add the places of an axis' pixels to a store, in mm from the middle of the image."""
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


def pixel_of(group: zarr.Group) -> float | None:
    """The pixel size in mm that `add_places` told a store; None if it was not called."""
    axis = AXIS_NAMES["W"]
    if axis not in group:
        return None
    stored: Any = group[axis]
    places = np.asarray(stored[:2], np.float64)
    return float(places[1] - places[0]) if len(places) == 2 else None
