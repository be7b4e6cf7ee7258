"""`Launch`, the argument of a node's launch function: its arrays on the device, and its kernels."""

from collections import Counter
from collections.abc import Callable, Hashable, Mapping
from typing import Any, TypeVar

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from tactograph.graph.backends.arrays import (
    DeviceArray,
    global_size,
    in_lanes,
    in_row_lanes,
    local_size,
)
from tactograph.graph.backends.compiled_node import Compiled
from tactograph.graph.backends.device_queue import Queue
from tactograph.graph.backends.kernel_source import scalar_values
from tactograph.graph.errors import NodeError

__all__ = ["DeviceArray", "Launch", "global_size", "local_size"]

T = TypeVar("T")


class Record:
    """The kernels that a launch enqueued, and its scratch buffers."""

    def __init__(self) -> None:
        self.kernels: list[Callable[[], cl.Event | None]] = []
        self.scratch: list[DeviceArray] = []


class Launch:
    """One launch of a node that needs more than one kernel, or a library.

    `repeats` is true as long as it only enqueued kernels, which can be enqueued again; `record`
    holds them.

    Attributes
    ----------
    lanes
        The number of elements that a work-item processes side by side: the kernels' LANES.
    group
        The size of a kernel that is a single work-group: the kernels' GROUP.
    units
        The number of the device's compute units: the cores of a CPU.
    """

    def __init__(
        self,
        queue: Queue,
        compiled: Compiled,
        inputs: Mapping[str, Any],
        outputs: Mapping[str, DeviceArray],
        settings: Mapping[str, Any],
        sizes: Mapping[str, int],
        record: Record | None = None,
    ) -> None:
        self._device, self._compiled = queue, compiled
        self.lanes, self.group, self.units = queue.lanes, queue.group, queue.units
        self._record = record
        self.repeats = True
        self.inputs = inputs
        self.outputs = dict(outputs)
        self.settings = settings
        self.sizes = dict(sizes)
        self._events: list[cl.Event] = []
        self._sent: list[cl.Event] = []
        self._captured: list[Callable[[], cl.Event]] | None = None
        self._copies: Counter[str] = Counter()

    @property
    def timer(self) -> tuple[cl.Event, cl.Event]:
        """The first and the last event; a marker's if there was none.

        Markers around every launch would be simpler, but Intel's runtime runs all work behind a
        marker on a single core.
        """
        if not self._events:
            self.repeats = False
            self._events.append(cl.enqueue_marker(self._device.queue))
        return self._events[0], self._events[-1]

    def in_lanes(self, *grid: int) -> tuple[int]:
        """The grid of a kernel in which each work-item processes LANES elements of this grid."""
        return in_lanes(grid, self.lanes)

    def in_row_lanes(self, *grid: int) -> tuple[int]:
        """The grid of a kernel in which each work-item processes LANES elements of one row."""
        return in_row_lanes(grid, self.lanes)

    @property
    def part(self) -> tuple[int] | None:
        """The size of work-groups that each process a part; on a CPU a part is one work-item's."""
        return None if self.lanes > 1 else (self.group,)

    @property
    def alone(self) -> tuple[int] | None:
        """The size of work-groups for kernels with much data per work-item: one item on a CPU."""
        return (1,) if self.lanes > 1 else None

    @property
    def queue(self) -> cl.CommandQueue:
        """The queue, for work that is enqueued by other means and cannot be repeated."""
        self.repeats = False
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
            Work-items needed, slowest axis first; rounded up to complete work-groups.
        arguments
            Device arrays, None for a null pointer, numbers, or pyopencl local memory; checked
            and converted by the kernel's own signature.
        local
            Work-group size, fastest axis first, if the kernel relies on it.
        constants
            Macros for the source, so that loops over them can be unrolled; the file is
            compiled once for each set of values.
        """
        local = local or local_size(len(grid), self.lanes)
        kernel = self._compiled.kernels_with(constants or {})[name]
        converted = kernel.converted(arguments)
        if self._captured is not None:
            kernel = kernel.numbered_copy(self._copies[name])
            self._copies[name] += 1
        elif self._record is not None:
            kernel = kernel.copy()
        bound = kernel.bind(self._device.queue, global_size(grid, local), local, converted)
        if self._captured is not None:
            self._captured.append(bound)
            return
        if self._record is not None:
            self._record.kernels.append(bound)
        self._events.append(bound())

    def own_kernel(self) -> None:
        """Enqueue the kernel that the node's declaration describes.

        Its arguments are those of `expected_arguments`: an absent array is a null pointer, an
        absent number 0.  It is compiled for float images or for the camera's integers.

        Raises
        ------
        NodeError
            If a size is not known.
        """
        node = self._compiled.node
        declared = node.kernels
        sizes = {s: 0 for s in node.symbols if node.may_lack(s)} | self.sizes
        for symbol in node.symbols:
            if symbol not in sizes:
                raise NodeError(f"the size {symbol} is not known where the node begins")
        grid = tuple(sizes[symbol] for symbol in declared.grid or ())
        if declared.lanes is not None:
            grid = (self.in_lanes if declared.lanes == "grid" else self.in_row_lanes)(*grid)
        arguments: list[Any] = []
        for name, port in node.inputs.items():
            if port.kind != "object":
                value = self.inputs.get(name)
                arguments.append(0 if value is None and port.kind == "number" else value)
        arguments += map(self.outputs.get, node.outputs)
        arguments += (sizes[symbol] for symbol in node.symbols)
        for name, parameter in node.parameters.items():
            arguments += scalar_values(parameter.annotation, self.settings[name])
        dtype = None if declared.integers is None else self.inputs[declared.integers].dtype
        are_integers = dtype is not None and dtype.kind != "f"
        constants = {"FULL": int(np.iinfo(dtype).max)} if are_integers else None
        self.kernel(node.name, grid, *arguments, constants=constants)

    def capture(self, launches: Callable[[], None]) -> Callable[[], None]:
        """Return a function that enqueues the kernels of `launches` at each call.

        Their arguments are set only once, now, so that enqueuing takes a fifth of the time.  Only
        the last captured sequence may be enqueued.
        """
        self.repeats = False
        captured: list[Callable[[], cl.Event]] = []
        self._captured, self._copies = captured, Counter()
        try:
            launches()
        finally:
            self._captured = None

        def enqueue() -> None:
            self._events.extend(launch() for launch in captured)

        return enqueue

    def scratch(self, shape: tuple[int, ...], dtype: Any = np.float32) -> DeviceArray:
        """Take a buffer from the pool, for this launch only."""
        buffer = self._device.empty(shape, np.dtype(dtype))
        if self._record is not None:
            self._record.scratch.append(buffer)
        return buffer

    def put(self, array: NDArray[Any]) -> DeviceArray:
        """Copy a host array, which may be empty, to a buffer of its own; `keep` keeps a constant.

        It does not come from the pool, whose buffers the queue may still use: a copy would wait.
        """
        self.repeats = False
        return self._device.constant(array)

    def send(self, array: NDArray[Any], to: DeviceArray) -> None:
        """Copy a host array to an existing buffer, behind all that was enqueued before."""
        self.repeats = False
        # The events hold the arrays; freeing them now would wait for the copy.
        self._sent.append(self._device.send(array, to))

    def download(self, array: DeviceArray) -> NDArray[Any]:
        """Wait for an array, and copy it to the host, whose next launch depends on its values."""
        self.repeats = False
        return self._device.download(array)

    def begin_download(self, array: DeviceArray) -> Callable[[], NDArray[Any]]:
        """Begin to copy an array to the host; return a function that waits for it.

        Kernels enqueued meanwhile keep the device busy.
        """
        self.repeats = False
        target, (_, copied) = self._device.start_download(array)

        def arrived() -> NDArray[Any]:
            copied.wait()
            return target

        return arrived

    def library(self, enqueue: Callable[[Any], object], array: DeviceArray, *, last: bool) -> None:
        """Enqueue a library's kernels over a pyopencl array.

        They return no event; the `last` operation of a launch is followed by a marker.
        """
        from pyopencl.array import Array  # slow, and rarely needed

        queue = self._device.queue
        view = Array(queue, array.shape, array.dtype, data=array.buffer)

        def launch() -> cl.Event | None:
            enqueue(view)
            return cl.enqueue_marker(queue) if last else None

        if self._record is not None:
            self._record.kernels.append(launch)
        event = launch()
        if event is not None:
            self._events.append(event)

    def set_size(self, symbol: str, size: int) -> None:
        """Set a size that depends on the data, and make the outputs that have it.

        An output with several such sizes is made when the last of them is set.
        """
        self.repeats = False
        node = self._compiled.node
        self.sizes[symbol] = size
        for name, port in node.outputs.items():
            sizes = {dim for dim in port.dims if isinstance(dim, str)}
            if symbol in sizes and sizes <= self.sizes.keys():
                assert port.dtype is not None
                shape = node.output_shape(name, self.sizes)
                self.outputs[name] = self._device.empty(shape, port.dtype)

    def keep(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the result of `make` for `key`, made once for this node on this device."""
        if key not in self._compiled.shared:
            # A repeated launch skips the work of `make`, unless that was recorded.
            repeats = self.repeats and self._record is None
            self._compiled.shared[key] = make()
            self.repeats = repeats
        value: T = self._compiled.shared[key]
        return value
