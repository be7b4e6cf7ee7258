"""A node's launch, worked out once for all items whose arrays have the same sizes.

An item with the same buffers and numbers enqueues the same kernels again, arguments included.
That takes a fifth of the time and skips the node's launch function.
"""

from collections.abc import Callable, Hashable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pyopencl as cl

from tactograph.graph.backends.arrays import (
    DeviceArray,
    Timer,
    bytes_for,
    global_size,
    in_lanes,
    in_row_lanes,
    local_size,
)
from tactograph.graph.backends.compiled_node import Compiled
from tactograph.graph.backends.device_queue import Queue
from tactograph.graph.backends.kernel import Kernel
from tactograph.graph.backends.launch import Launch, Record
from tactograph.graph.declare.engine_arguments import Wanted
from tactograph.graph.errors import NodeError

MAX_BUFFER_SETS = 4
"""Sets of buffers for which a node's launch is kept: recalled values alternate."""


class Repeatable(NamedTuple):
    """Kernels with their arguments set, and bytes and numbers of their scratch buffers."""

    kernels: tuple[Callable[[], cl.Event | None], ...]
    scratch: tuple[int, ...]
    numbers: tuple[int, ...]


class Prepared:
    """A node on a device with known sizes; only buffers differ from item to item.

    `shapes` are those of its outputs, None where one of them depends on the data: the launch
    function then makes that output.
    """

    def __init__(
        self,
        queue: Queue,
        compiled: Compiled,
        settings: Mapping[str, Any],
        sizes: Mapping[str, int],
        wanted: Wanted,
    ) -> None:
        self._device, self._compiled = queue, compiled
        self._settings, self.sizes = settings, sizes
        self._node = node = compiled.node
        self._declared = node.kernels
        self._repeats = True
        self._records: dict[Hashable, Repeatable | None] = {}
        self._read = [name for name, port in node.inputs.items() if port.kind != "object"]
        self._outputs: dict[str, tuple[int, tuple[int, ...], np.dtype[Any]]] = {}
        self.shapes: dict[str, tuple[int, ...]] | None = {}
        for name, port in node.outputs.items():
            assert port.dtype is not None
            if node.wanted is not None and name not in wanted:
                continue
            if not all(isinstance(d, int) or d in sizes for d in port.dims):
                self.shapes = None
                continue
            shape = node.output_shape(name, sizes)
            self._outputs[name] = bytes_for(shape, port.dtype), shape, port.dtype
            if self.shapes is not None:
                self.shapes[name] = shape
        if self._declared.grid is not None:
            self._prepare_kernel(self._declared.grid)

    def _prepare_kernel(self, symbols: tuple[str, ...]) -> None:
        """Work out the launch of the node's own kernel, except for buffers."""
        node = self._node
        absent = {s for s in node.symbols if s not in self.sizes and node.may_lack(s)}
        sizes = {**self.sizes, **dict.fromkeys(absent, 0)}
        for symbol in node.symbols:
            if symbol not in sizes:
                raise NodeError(f"the size {symbol} is not known where the node begins")
        grid = tuple(sizes[symbol] for symbol in symbols)
        if self._declared.lanes == "grid":
            grid = in_lanes(grid, self._device.lanes)
        elif self._declared.lanes == "rows":
            grid = in_row_lanes(grid, self._device.lanes)
        self._kernels: dict[np.dtype[Any], Kernel] = {}
        self._local = local_size(len(grid), self._device.lanes)
        self._work_items = global_size(grid, self._local)
        self._plain = [np.int32(sizes[symbol]) for symbol in node.symbols]
        for name, convert in self._compiled.converters.items():
            self._plain += convert(self._settings[name])

    def launch(self, inputs: Mapping[str, Any]) -> tuple[dict[str, DeviceArray], Timer]:
        """Enqueue the node; return its outputs, which are not ready yet, and its two events.

        Parameters
        ----------
        inputs
            By name: device arrays of the prepared sizes, None for an absent one, and numbers.
        """
        take = self._device.take
        outputs = {name: take(*layout) for name, layout in self._outputs.items()}
        if not self._repeats or self._device.poison is not None:
            return self._launched(inputs, outputs)
        key = (*map(_identity, map(inputs.get, self._read)), *map(_identity, outputs.values()))
        repeatable = self._records.get(key)
        if repeatable is not None:
            scratch = [self._device.pool.take(nbytes) for nbytes in repeatable.scratch]
            if all(m.number == n for m, n in zip(scratch, repeatable.numbers, strict=True)):
                enqueued = (enqueue() for enqueue in repeatable.kernels)
                events = [event for event in enqueued if event is not None]
                return outputs, (events[0], events[-1])
            del scratch
            return self._launched(inputs, outputs)
        # Not the first time: copying kernels takes longer than enqueuing them a few times.
        record = Record() if key in self._records else None
        results = self._launched(inputs, outputs, record)
        self._records[key] = None if record is None else _repeatable(record)
        if len(self._records) > MAX_BUFFER_SETS:
            del self._records[next(iter(self._records))]
        return results

    def _launched(
        self,
        inputs: Mapping[str, Any],
        outputs: dict[str, DeviceArray],
        record: Record | None = None,
    ) -> tuple[dict[str, DeviceArray], Timer]:
        device, settings = self._device, self._settings
        launch = Launch(device, self._compiled, inputs, outputs, settings, self.sizes, record)
        if self._declared.launch is not None:
            self._declared.launch(launch)
        else:
            arguments = self._arguments(inputs, outputs)
            launch.enqueue(self._kernel(inputs), self._work_items, self._local, arguments)
        timer = launch.timer  # which marks the queue where nothing was enqueued
        self._repeats = launch.repeats
        return launch.outputs, timer

    def _arguments(
        self, inputs: Mapping[str, Any], outputs: Mapping[str, DeviceArray]
    ) -> list[Any]:
        """The arguments of the node's own kernel, in the order of `expected_arguments`.

        An absent array is a null pointer, an absent number 0.
        """
        arguments: list[Any] = []
        for name in self._read:
            value = inputs.get(name)
            if self._node.inputs[name].kind == "number":
                arguments.append(np.float32(0 if value is None else value))
            else:
                arguments.append(None if value is None else value.buffer)
        for name in self._node.outputs:
            arguments.append(outputs[name].buffer if name in outputs else None)
        return arguments + self._plain

    def _kernel(self, inputs: Mapping[str, Any]) -> Kernel:
        """The kernel, compiled for float images or for the camera's integers."""
        node, whole = self._node, self._declared.whole
        dtype = np.dtype(np.float32) if whole is None else inputs[whole].dtype
        if dtype not in self._kernels:
            constants = {} if dtype.kind == "f" else {"FULL": np.iinfo(dtype).max}
            self._kernels[dtype] = self._compiled.kernels_with(constants)[node.name]
        return self._kernels[dtype]


def _repeatable(record: Record) -> Repeatable | None:
    if not record.kernels:
        return None
    arrays = record.scratch
    return Repeatable(
        tuple(record.kernels),
        tuple(bytes_for(array.shape, array.dtype) for array in arrays),
        tuple(array.memory.number for array in arrays),
    )


def _identity(argument: DeviceArray | float | None) -> Hashable:
    """The identity of an argument: its buffer, element type and shape, or the number itself."""
    if isinstance(argument, DeviceArray):
        return argument.memory.number, argument.dtype.num, argument.shape
    return argument
