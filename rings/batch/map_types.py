"""The maps in a store: their types, the names of their dimensions, the places of pixels."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

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

    def in_one_piece(self, chunk: int) -> int:
        """The number of maps that are compressed as one piece; it divides the `chunk`."""
        most = max(1, COMPRESSED_BYTES // max(1, self.nbytes))
        return max(n for n in range(1, chunk + 1) if chunk % n == 0 and n <= most)


def captures_together(types: Iterable[MapType]) -> int:
    """The number of captures to write together: a power of two whose maps a worker can hold."""
    fit = MAX_BUFFERED_BYTES // max(1, sum(kind.nbytes for kind in types))
    return max(1, min(MAX_CHUNK_CAPTURES, 1 << max(0, fit.bit_length() - 1)))


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
