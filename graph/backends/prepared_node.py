"""A node's launch, worked out once for all items whose arrays have the same sizes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from tactograph.graph.backends.arrays import (
    DeviceArray,
    bytes_for,
    global_size,
    in_lanes,
    in_row_lanes,
    local_size,
)
from tactograph.graph.backends.compiled_node import Compiled
from tactograph.graph.backends.device_backend import Timer
from tactograph.graph.backends.device_queue import Queue
from tactograph.graph.backends.kernel import Kernel
from tactograph.graph.backends.kernel_declaration import LaunchFunction
from tactograph.graph.backends.launch import Launch
from tactograph.graph.declare.wanted_outputs import Wanted
from tactograph.graph.errors import NodeError


class Prepared:
    """A node on a device, its arrays' sizes known: from item to item only buffers differ.

    `shapes` are those of its outputs, None where a launch function may make some of its own.
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
        self._outputs: dict[str, tuple[int, tuple[int, ...], np.dtype[Any]]] = {}
        for name, port in node.outputs.items():
            assert port.dtype is not None
            # The launch function makes those whose size only the data tells.
            is_known = all(isinstance(d, int) or d in sizes for d in port.dims)
            if is_known and (node.wanted is None or name in wanted):
                shape = node.output_shape(name, sizes)
                self._outputs[name] = bytes_for(shape, port.dtype), shape, port.dtype
        self.shapes: dict[str, tuple[int, ...]] | None = None
        if self._declared.grid is not None:
            self.shapes = {name: shape for name, (_, shape, _) in self._outputs.items()}
            self._prepare_kernel(self._declared.grid)

    def _prepare_kernel(self, symbols: tuple[str, ...]) -> None:
        """Work out all that the node's own kernel is launched with, buffers excepted."""
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
        self._kernels = {np.dtype(np.float32): self._compiled.kernels_with({})[node.name]}
        self._local = local_size(len(grid))
        self._work_items = global_size(grid, self._local)
        self._taken = [
            (name, port.kind) for name, port in node.inputs.items() if port.kind != "object"
        ]
        self._plain = [np.int32(sizes[symbol]) for symbol in node.symbols]
        for name, convert in self._compiled.converters.items():
            self._plain += convert(self._settings[name])

    def launch(self, inputs: Mapping[str, Any]) -> tuple[dict[str, DeviceArray], Timer]:
        """Enqueue the node; return its outputs, which are not ready yet, and its two events.

        Parameters
        ----------
        inputs
            By name: device arrays of the sizes that this was prepared for, None for one that
            is absent, and numbers.
        """
        take = self._device.take
        outputs = {name: take(*known) for name, known in self._outputs.items()}
        if self._declared.launch is not None:
            return self._by_function(self._declared.launch, inputs, outputs)
        # In the order of `kernel_source.expected_arguments`.
        arguments: list[Any] = []
        for name, kind in self._taken:
            found = inputs.get(name)
            if kind == "number":
                arguments.append(np.float32(found))
            else:
                arguments.append(None if found is None else found.buffer)
        for name in self._node.outputs:
            arguments.append(outputs[name].buffer if name in outputs else None)
        arguments += self._plain
        queue, kernel = self._device.queue, self._kernel(inputs)
        event = kernel.enqueue(queue, self._work_items, self._local, arguments)
        return outputs, (event, event)

    def _kernel(self, inputs: Mapping[str, Any]) -> Kernel:
        """The kernel, compiled for float images or for the camera's integers."""
        node, whole = self._node, self._declared.whole
        dtype = np.dtype(np.float32) if whole is None else inputs[whole].dtype
        if dtype not in self._kernels:
            whole_kernels = self._compiled.kernels_with({"FULL": np.iinfo(dtype).max})
            self._kernels[dtype] = whole_kernels[node.name]
        return self._kernels[dtype]

    def _by_function(
        self, function: LaunchFunction, inputs: Mapping[str, Any], outputs: dict[str, DeviceArray]
    ) -> tuple[dict[str, DeviceArray], Timer]:
        device, settings = self._device, self._settings
        launch = Launch(device, self._compiled, inputs, outputs, settings, self.sizes)
        function(launch)
        return launch.outputs, launch.timer
