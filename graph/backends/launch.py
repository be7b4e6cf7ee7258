"""What a node's launch function is handed: its arrays on the device, and how to run kernels."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
import pyopencl as cl
import pyopencl.array
from numpy.typing import NDArray

if TYPE_CHECKING:
    from tactograph.graph.backends.opencl import Compiled, OpenCL

T = TypeVar("T")


class DeviceArray(NamedTuple):
    """A buffer on the device with the shape and type of the array in it."""

    buffer: Any
    shape: tuple[int, ...]
    dtype: np.dtype[Any]

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


class Launch:
    """One launch of a node that needs more than one kernel, or a library."""

    def __init__(
        self,
        device: OpenCL,
        compiled: Compiled,
        inputs: Mapping[str, Any],
        outputs: Mapping[str, DeviceArray],
        settings: Mapping[str, Any],
        sizes: Mapping[str, int],
    ) -> None:
        self._device = device
        self._compiled = compiled
        self.inputs = inputs
        self.outputs = dict(outputs)
        self.settings = settings
        self.sizes = dict(sizes)
        self._events: list[cl.Event] = []

    @property
    def timer(self) -> tuple[cl.Event, cl.Event]:
        """The first and the last event; a marker's if there was none.

        Markers around every launch would tell the same, but Intel's runtime runs all that
        follows a marker on a single core.
        """
        if not self._events:
            self._events.append(cl.enqueue_marker(self.queue))
        return self._events[0], self._events[-1]

    @property
    def lanes(self) -> int:
        """How many elements a work-item should do side by side; the kernels' LANES."""
        return self._device.lanes

    def in_lanes(self, *grid: int) -> tuple[int]:
        """The grid of a kernel that does LANES elements of this one in each work-item."""
        return in_lanes(grid, self.lanes)

    def in_row_lanes(self, *grid: int) -> tuple[int]:
        """The same for a kernel in which none goes on into the next row."""
        return in_row_lanes(grid, self.lanes)

    @property
    def group(self) -> int:
        """Work-items of a kernel that is a single work-group; the kernels' GROUP."""
        return 1 if self.lanes > 1 else 128

    @property
    def queue(self) -> cl.CommandQueue:
        return self._device.queue

    def kernel(
        self,
        name: str,
        grid: tuple[int, ...],
        *arguments: Any,
        local: tuple[int, ...] | None = None,
        constants: Mapping[str, int] | None = None,
    ) -> None:
        """Enqueue one kernel of the node's ``.cl`` file.

        Parameters
        ----------
        name
            The kernel.
        grid
            Work-items needed, slowest axis first; rounded up to whole work-groups.
        arguments
            Device arrays, None for a null pointer, numbers, or pyopencl local memory; checked
            and converted by the kernel's own signature.
        local
            Work-group size, fastest axis first, where the kernel relies on it.
        constants
            What the source sees as macros, so that loops over them can be unrolled; the
            file is compiled once for each set of values.
        """
        local = local or local_size(len(grid))
        compiled = self._device.compile(self._compiled.node, constants) if constants else None
        kernel = (compiled or self._compiled).kernels[name]
        plain = kernel.converted(arguments)
        self._events.append(kernel.enqueue(self.queue, global_size(grid, local), local, plain))

    def scratch(self, shape: tuple[int, ...], dtype: Any = np.float32) -> DeviceArray:
        """A buffer for this launch alone, from the pool."""
        return self._device.empty(shape, np.dtype(dtype))

    def upload(self, array: Any) -> DeviceArray:
        """Copy a host array to the device, to stay there: for constants, inside `keep`."""
        return self._device.constant(array)

    def put(self, array: NDArray[Any]) -> DeviceArray:
        """Copy a host array, which may be empty, to a buffer for this launch alone."""
        return self._device.upload(array)

    def download(self, array: DeviceArray) -> NDArray[Any]:
        """Wait for an array and copy it to the host: for what decides the next launch."""
        return self._device.download(array)

    def found(self, symbol: str, size: int) -> None:
        """Say how large a size symbol is that only the data tells, and make the outputs with it."""
        node = self._compiled.node
        self.sizes[symbol] = size
        for name, port in node.outputs.items():
            if symbol in port.dims:
                assert port.dtype is not None
                shape = node.output_shape(name, self.sizes)
                self.outputs[name] = self._device.empty(shape, port.dtype)

    def keep(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what `make` made for `key`, made once for this node on this device."""
        if key not in self._compiled.kept:
            self._compiled.kept[key] = make()
        found: T = self._compiled.kept[key]
        return found


def as_array(queue: cl.CommandQueue, found: DeviceArray) -> pyopencl.array.Array:
    """Look at a device array as pyopencl's own array class, which libraries take."""
    return pyopencl.array.Array(queue, found.shape, found.dtype, data=found.buffer)


_ELEMENTS = {
    "float": ("float32", "complex64"),
    "uchar": ("uint8",),
    "ushort": ("uint16",),
    "int": ("int32",),
    "uint": ("uint32",),
    "PIXEL": ("uint8", "uint16", "float32"),
}
"""What an array may hold that a kernel reads as a type, or as vectors of it."""
_WHOLE: dict[str, Callable[[int], Any]] = {
    "int": np.int32, "uint": np.uint32, "uchar": np.uint8, "ushort": np.uint16
}  # fmt: skip


def converter(c_type: str) -> Callable[[Any], Any]:
    """What makes a kernel's argument of a value; it raises where the value is no such thing."""
    if c_type.endswith("*"):
        dtypes = _ELEMENTS.get(c_type.rstrip("*").rstrip("0123456789"))
        known = None if dtypes is None else frozenset(map(np.dtype, dtypes))
        return partial(_buffer, known)
    if c_type == "float":
        return _float
    return partial(_whole, _WHOLE[c_type]) if c_type in _WHOLE else _as_it_is


def in_words(value: Any) -> str:
    """A value that a kernel cannot take, for an error."""
    if isinstance(value, DeviceArray):
        return f"an array of {value.dtype}"
    return f"{value!r} ({type(value).__name__})"


def _buffer(dtypes: frozenset[np.dtype[Any]] | None, value: Any) -> Any:
    if isinstance(value, DeviceArray):
        if dtypes is not None and value.dtype not in dtypes:
            raise TypeError
        return value.buffer
    if value is None or isinstance(value, cl.LocalMemory | cl.MemoryObjectHolder):
        return value
    raise TypeError


def _float(value: Any) -> np.float32:
    if isinstance(value, float | int | np.floating | np.integer):
        return np.float32(value)
    raise TypeError


def _whole(make: Callable[[int], Any], value: Any) -> Any:
    if isinstance(value, int | np.integer):
        return make(int(value))  # which refuses what is out of range
    raise TypeError


def _as_it_is(value: Any) -> Any:
    return value
