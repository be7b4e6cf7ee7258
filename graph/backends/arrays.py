"""Arrays on a device, and the grids of work-items that process them."""

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from tactograph.graph.backends.buffer_pool import Memory

Timer = tuple[Any, Any]
"""The first and the last event of a timed operation."""


class DeviceArray(NamedTuple):
    """A buffer on the device with the shape and type of the array in it."""

    memory: Memory
    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    @property
    def buffer(self) -> Any:
        """The buffer for kernels and copies, which belongs to this array as long as it exists."""
        return self.memory.buffer

    @property
    def nbytes(self) -> int:
        return math.prod(self.shape) * self.dtype.itemsize


def bytes_for(shape: tuple[int, ...], dtype: np.dtype[Any]) -> int:
    """The size of a buffer for an array, rounded up to words of four bytes, at least one word."""
    return -(-max(math.prod(shape) * dtype.itemsize, 1) // 4) * 4


def in_lanes(grid: tuple[int, ...], lanes: int) -> tuple[int]:
    """The number of work-items that each process `lanes` elements of the flattened grid."""
    return (-(-math.prod(grid) // lanes),)


def in_row_lanes(grid: tuple[int, ...], lanes: int) -> tuple[int]:
    """The number of work-items that each process up to `lanes` elements of one row."""
    return (math.prod(grid[:-1]) * -(-grid[-1] // lanes),)


def local_size(axes: int, lanes: int = 1) -> tuple[int, ...]:
    """Work-group size: a run of 128 along the fastest axis, which vectorises on CPUs too.

    Work-items of several lanes are few; smaller groups distribute them evenly.
    """
    return (128 if axes > 1 or lanes == 1 else 32, *(1,) * (axes - 1))


@lru_cache(maxsize=1024)
def global_size(grid: tuple[int, ...], local: tuple[int, ...]) -> tuple[int, ...]:
    """Convert a grid, slowest axis first, to work-items, fastest axis first, in complete groups."""
    return tuple(-(-n // m) * m for n, m in zip(reversed(grid), local, strict=True))
