"""The OpenCL back end: one device, one in-order queue, one pool of buffers.

Nothing waits but a download.  Buffers return to the pool when the plan says that their value
has been read for the last time; on an in-order queue the next owner cannot overtake.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyopencl as cl
import pyopencl.tools
from numpy.typing import NDArray

from tactograph.graph.backends.devices import Device
from tactograph.graph.backends.kernel_source import kernel_source, scalar_type
from tactograph.graph.backends.launch import DeviceArray, Launch, global_size, local_size
from tactograph.graph.errors import NodeError
from tactograph.graph.node import Node

Timer = tuple[cl.Event, cl.Event]


@dataclass
class Compiled:
    """A node's kernels on one device, and what its launches keep from one to the next."""

    node: Node
    kernels: dict[str, cl.Kernel]
    kept: dict[Any, Any]


class OpenCL:
    """One OpenCL device with its queue, its buffers and its compiled nodes."""

    def __init__(self, device: Device) -> None:
        self.name = device.name
        self.context = cl.Context([device.handle])
        profiling = cl.command_queue_properties.PROFILING_ENABLE
        self.queue = cl.CommandQueue(self.context, properties=profiling)
        self.pool = pyopencl.tools.MemoryPool(pyopencl.tools.ImmediateAllocator(self.queue))
        self.poison: int | None = None
        self._compiled: dict[int, Compiled] = {}
        self._options = ["-cl-std=CL1.2"]
        correctly_rounded = cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT
        if device.handle.single_fp_config & correctly_rounded:
            self._options.append("-cl-fp32-correctly-rounded-divide-sqrt")

    def compile(self, node: Node) -> Compiled:
        """Compile a node's kernels, or return them; pyopencl caches binaries on disk.

        Raises
        ------
        NodeError
            If the source does not match the declaration, or does not compile.
        """
        if id(node) not in self._compiled:
            program = cl.Program(self.context, kernel_source(node))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # compilers' remarks on their own speed
                try:
                    program = program.build(options=self._options)
                except cl.RuntimeError as error:
                    lines = [line for line in str(error).splitlines() if "error" in line.lower()]
                    reason = lines[0] if lines else str(error)
                    raise NodeError(f"kernels/{node.name}.cl does not compile: {reason}") from None
            kernels = {kernel.function_name: kernel for kernel in program.all_kernels()}
            self._compiled[id(node)] = Compiled(node, kernels, {})
        return self._compiled[id(node)]

    def empty(self, shape: tuple[int, ...], dtype: np.dtype[Any]) -> DeviceArray:
        """Take a buffer from the pool; an empty array still gets some bytes to point at.

        With `poison` set, every byte of it holds that value, so that a test can tell an
        element that a kernel failed to write.
        """
        nbytes = -(-max(int(np.prod(shape, dtype=np.int64)) * dtype.itemsize, 1) // 4) * 4
        buffer: Any = self.pool.allocate(nbytes)
        if self.poison is not None:
            # A copy, not a fill: oclgrind takes filled buffers for uninitialised ones.
            cl.enqueue_copy(self.queue, buffer, np.full(nbytes, self.poison, np.uint8))
        return DeviceArray(buffer, shape, dtype)

    def upload(self, array: NDArray[Any]) -> DeviceArray:
        """Copy a host array to the device."""
        target = self.empty(array.shape, array.dtype)
        if array.size:
            cl.enqueue_copy(self.queue, target.buffer, np.ascontiguousarray(array))
        return target

    def download(self, source: DeviceArray) -> NDArray[Any]:
        """Wait for an array and copy it to the host."""
        target = np.empty(source.shape, source.dtype)
        if target.size:
            cl.enqueue_copy(self.queue, target, source.buffer)
        return target

    def fill(self, shape: tuple[int, ...], dtype: np.dtype[Any], value: float) -> DeviceArray:
        """Make a constant array on the device."""
        target = self.empty(shape, dtype)
        pattern = np.array([value], dtype)
        cl.enqueue_fill_buffer(
            self.queue, target.buffer, pattern, 0, max(target.nbytes, dtype.itemsize)
        )
        return target

    def run(
        self,
        node: Node,
        inputs: Mapping[str, Any],
        settings: Mapping[str, Any],
        sizes: Mapping[str, int],
    ) -> tuple[dict[str, DeviceArray], Timer]:
        """Launch a node; return its outputs, which are not ready yet, and its two events."""
        compiled = self.compile(node)
        outputs = {}
        for name, port in node.outputs.items():
            assert port.dtype is not None
            shape = tuple(d if isinstance(d, int) else sizes[d] for d in port.dims)
            outputs[name] = self.empty(shape, port.dtype)
        if node.launch is not None:
            before = cl.enqueue_marker(self.queue)
            node.launch(Launch(self, compiled, inputs, outputs, settings, sizes))
            return outputs, (before, cl.enqueue_marker(self.queue))
        assert node.grid is not None
        kernel = compiled.kernels[node.name]
        kernel.set_args(*_arguments(node, inputs, outputs, settings, sizes))
        grid = tuple(sizes[symbol] for symbol in node.grid)
        local = local_size(len(grid))
        event = cl.enqueue_nd_range_kernel(self.queue, kernel, global_size(grid, local), local)
        return outputs, (event, event)

    def finish(self) -> None:
        self.queue.finish()


def milliseconds(timer: Timer) -> float:
    """The time between the start of the first event and the end of the last, on the device."""
    first, last = timer
    return float(last.profile.end - first.profile.start) * 1e-6


def _arguments(
    node: Node,
    inputs: Mapping[str, Any],
    outputs: Mapping[str, DeviceArray],
    settings: Mapping[str, Any],
    sizes: Mapping[str, int],
) -> list[Any]:
    arguments: list[Any] = []
    for name, port in node.inputs.items():
        value = inputs.get(name)
        if port.kind == "array":
            arguments.append(value.buffer if value is not None else None)
        elif port.kind == "number":
            arguments.append(np.float32(value))
    arguments += [array.buffer for array in outputs.values()]
    arguments += [np.int32(sizes[symbol]) for symbol in node.symbols]
    for name, parameter in node.parameters.items():
        arguments += setting_arguments(parameter.annotation, settings[name])
    return arguments


def setting_arguments(annotation: Any, value: Any) -> list[Any]:
    """A parameter as kernel arguments: numbers as they are, a choice by its index."""
    found = scalar_type(annotation)
    assert found is not None
    c_type, count, choices = found
    make = np.float32 if c_type == "float" else np.int32
    if choices:
        return [np.int32(choices.index(value))]
    return [make(v) for v in value] if count > 1 else [make(value)]
