"""Arrays on a device, and the work-items that go over them."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from tactograph.graph.backends.buffer_pool import Memory


class DeviceArray(NamedTuple):
    """A buffer on the device with the shape and type of the array in it."""

    memory: Memory
    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    @property
    def buffer(self) -> Any:
        """What kernels and copies take; it is this array's as long as that is held."""
        return self.memory.buffer

    @property
    def nbytes(self) -> int:
        return math.prod(self.shape) * self.dtype.itemsize


def bytes_for(shape: tuple[int, ...], dtype: np.dtype[Any]) -> int:
    """The size of a buffer for an array, at least some bytes and in words of four."""
    return -(-max(math.prod(shape) * dtype.itemsize, 1) // 4) * 4


def in_lanes(grid: tuple[int, ...], lanes: int) -> tuple[int]:
    """Work-items that do so many elements each of a grid that is counted through as one axis."""
    return (-(-math.prod(grid) // lanes),)


def in_row_lanes(grid: tuple[int, ...], lanes: int) -> tuple[int]:
    """The same, but none goes on into the next row."""
    return (math.prod(grid[:-1]) * -(-grid[-1] // lanes),)


def local_size(axes: int) -> tuple[int, ...]:
    """Work-group size: a run of 128 along the fastest axis, which vectorises on CPUs too."""
    return (128, *(1,) * (axes - 1))


def global_size(grid: tuple[int, ...], local: tuple[int, ...]) -> tuple[int, ...]:
    """Grid, slowest axis first, to work-items, fastest axis first, in whole groups."""
    return tuple(-(-n // m) * m for n, m in zip(reversed(grid), local, strict=True))
