"""The OpenCL back end: one device, one in-order queue, one pool of buffers.

Nothing waits but a download.  Buffers return to the pool when the plan says that their value
has been read for the last time; on an in-order queue the next owner cannot overtake.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from typing import Any, Literal

import numpy as np
import pyopencl as cl
import pyopencl.tools
from numpy.typing import NDArray

from tactograph.graph.backends.devices import Device
from tactograph.graph.backends.events import Timer
from tactograph.graph.backends.kernel_source import (
    Argument,
    kernel_signatures,
    kernel_source,
    scalar_type,
)
from tactograph.graph.backends.launch import (
    DeviceArray,
    bytes_for,
    converter,
    global_size,
    in_lanes,
    in_words,
    local_size,
)
from tactograph.graph.backends.prepared import Prepared
from tactograph.graph.declare.node import Node
from tactograph.graph.declare.wanted_outputs import EVERYTHING, Wanted
from tactograph.graph.errors import NodeError


class Kernel:
    """A kernel whose arguments have the types that they had at its first launch.

    Told of them, pyopencl sets all arguments in the time that a single number takes otherwise.
    `signature` is what its source says that it takes.
    """

    def __init__(self, kernel: cl.Kernel, signature: Sequence[Argument] = ()) -> None:
        self._kernel = kernel
        self._signature = signature
        self._converters = [converter(c_type) for c_type, _ in signature]
        self._typed = False

    def converted(self, arguments: Sequence[Any]) -> list[Any]:
        """The arguments as the kernel takes them: numbers of its types, and buffers.

        Raises
        ------
        TypeError
            If there are too many or too few, or one is not what the kernel takes.
        """
        try:
            pairs = zip(self._converters, arguments, strict=True)
            return [convert(value) for convert, value in pairs]
        except (TypeError, ValueError, OverflowError):
            raise TypeError(self._complaint(arguments)) from None

    def _complaint(self, arguments: Sequence[Any]) -> str:
        name = f"kernel {self._kernel.function_name}"
        if len(arguments) != len(self._signature):
            takes = ", ".join(name for _, name in self._signature)
            return f"{name} takes {len(self._signature)} arguments ({takes}), not {len(arguments)}"
        for number, (value, convert) in enumerate(
            zip(arguments, self._converters, strict=True), start=1
        ):
            try:
                convert(value)
            except (TypeError, ValueError, OverflowError):
                taken = " ".join(self._signature[number - 1])
                return f"{name}: argument {number} is '{taken}', not {in_words(value)}"
        raise AssertionError(name)

    def enqueue(
        self,
        queue: cl.CommandQueue,
        work_items: tuple[int, ...],
        local: tuple[int, ...],
        arguments: Sequence[Any],
    ) -> cl.Event:
        """Launch over `work_items` in work-groups of `local`, both fastest axis first."""
        if not self._typed:
            types = [type(a) if isinstance(a, np.generic) else None for a in arguments]
            self._kernel.set_arg_types(types)
            self._typed = True
        return self._kernel(queue, work_items, local, *arguments)


Convert = Callable[[Any], list[Any]]
"""From a parameter's value to kernel arguments."""


class Compiled:
    """A node's kernels on one device, and what its launches keep from one to the next."""

    def __init__(self, node: Node, build: Callable[[], dict[str, Kernel]]) -> None:
        self.node = node
        self.converters = _converters(node)
        self.kept: dict[Any, Any] = {}
        self._build = build

    @cached_property
    def kernels(self) -> dict[str, Kernel]:
        """By name; built when first asked for."""
        return self._build()


_FRACTION = """
#if LANES == 16
__attribute__((vec_type_hint(float16)))
#endif
__kernel void fraction(
    __global const WHOLE *restrict whole, __global float *restrict out,
    const int N, const float full)
{
    const int start = get_global_id(0) * LANES;
#if LANES == 16
    if (start + LANES <= N) {
        vstore16(convert_float16(vload16(0, whole + start)) / full, 0, out + start);
        return;
    }
#endif
    for (int i = start; i < min(start + LANES, N); ++i)
        out[i] = convert_float(whole[i]) / full;
}
"""


class OpenCL:
    """One OpenCL device with its queue, its buffers and its compiled nodes.

    `lanes` is how many elements a work-item does side by side; None takes what suits the
    device: CPUs' compilers do not all vectorise across work-items, GPUs want one each.
    """

    def __init__(self, device: Device, lanes: Literal[1, 16] | None = None) -> None:
        self.name = device.name
        self.is_cpu = device.kind == "CPU"
        self.lanes = lanes or (16 if self.is_cpu else 1)
        self.context = cl.Context([device.handle])
        profiling = cl.command_queue_properties.PROFILING_ENABLE
        self.queue = cl.CommandQueue(self.context, properties=profiling)
        self.pool = pyopencl.tools.MemoryPool(pyopencl.tools.ImmediateAllocator(self.queue))
        self.poison: int | None = None
        self._compiled: dict[tuple[int, tuple[tuple[str, int], ...]], Compiled] = {}
        self._options = ["-cl-std=CL1.2"]
        correctly_rounded = cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT
        if device.handle.single_fp_config & correctly_rounded:
            self._options.append("-cl-fp32-correctly-rounded-divide-sqrt")

    def compile(self, node: Node, constants: Mapping[str, int] | None = None) -> Compiled:
        """Compile a node's kernels, or return them; pyopencl caches binaries on disk.

        `constants` are defined as macros, besides LANES.

        Raises
        ------
        NodeError
            If the source does not match the declaration, or does not compile.
        """
        key = id(node), tuple((constants or {}).items())
        if key not in self._compiled:
            compiled = Compiled(node, partial(self._build, node, constants or {}))
            # A launch function may want its kernels with constants, and never without.
            if node.launch is None or constants:
                _ = compiled.kernels
            self._compiled[key] = compiled
        return self._compiled[key]

    def _build(self, node: Node, constants: Mapping[str, int]) -> dict[str, Kernel]:
        source = kernel_source(node)
        signatures = kernel_signatures(source)
        program = cl.Program(self.context, source)
        macros = [f"-D{name}={value}" for name, value in {"LANES": self.lanes, **constants}.items()]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # compilers' remarks on their own speed
            try:
                program = program.build(options=[*self._options, *macros])
            except cl.RuntimeError as error:
                lines = [line for line in str(error).splitlines() if "error" in line.lower()]
                reason = lines[0] if lines else str(error)
                raise NodeError(f"kernels/{node.name}.cl does not compile: {reason}") from None
        return {
            kernel.function_name: Kernel(kernel, signatures[kernel.function_name])
            for kernel in program.all_kernels()
        }

    def empty(self, shape: tuple[int, ...], dtype: np.dtype[Any]) -> DeviceArray:
        """Take a buffer from the pool; an empty array still gets some bytes to point at.

        With `poison` set, every byte of it holds that value, so that a test can tell an
        element that a kernel failed to write.
        """
        return self.take(bytes_for(shape, dtype), shape, dtype)

    def take(self, nbytes: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> DeviceArray:
        """`empty`, with the result of `bytes_for` at hand."""
        buffer: Any = self.pool.allocate(nbytes)
        if self.poison is not None:
            # A copy, not a fill: oclgrind takes filled buffers for uninitialised ones.
            cl.enqueue_copy(self.queue, buffer, np.full(nbytes, self.poison, np.uint8))
        return DeviceArray(buffer, shape, dtype)

    def upload(self, array: NDArray[Any]) -> DeviceArray:
        """Copy a host array to the device."""
        target, (_, copied) = self.start_upload(array)
        copied.wait()
        return target

    def start_upload(self, array: NDArray[Any]) -> tuple[DeviceArray, Timer]:
        """Begin to copy a host array, which must not change before the event."""
        target = self.empty(array.shape, array.dtype)
        if not array.size:
            return target, self._now()
        source = np.ascontiguousarray(array)
        event = cl.enqueue_copy(self.queue, target.buffer, source, is_blocking=False)
        return target, (event, event)

    def start_upload_of_fraction(self, array: NDArray[Any]) -> tuple[DeviceArray, Timer]:
        """Begin to copy unsigned integers, and there make them fractions of full scale.

        A quarter of the bytes of float32 for 8 bits; the same values as on the host.
        """
        source, (started, _) = self.start_upload(array)
        target = self.empty(array.shape, np.dtype(np.float32))
        full = np.float32(np.iinfo(array.dtype).max)
        kernel = self._fraction[array.dtype.itemsize]
        local = local_size(1)
        work_items = global_size(in_lanes(array.shape, self.lanes), local)
        arguments = (source.buffer, target.buffer, np.int32(array.size), full)
        return target, (started, kernel.enqueue(self.queue, work_items, local, arguments))

    def _now(self) -> Timer:
        marker = cl.enqueue_marker(self.queue)
        return marker, marker

    @cached_property
    def _fraction(self) -> dict[int, Kernel]:
        """The kernels of `start_upload_of_fraction`, by bytes per element."""
        return {
            size: Kernel(
                cl.Program(self.context, _FRACTION)
                .build(options=[*self._options, f"-DLANES={self.lanes}", f"-DWHOLE={whole}"])
                .fraction
            )
            for size, whole in ((1, "uchar"), (2, "ushort"))
        }

    def constant(self, array: NDArray[Any]) -> DeviceArray:
        """Copy a host array to a buffer of its own, that the pool does not lack afterwards."""
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        buffer = cl.Buffer(self.context, flags, hostbuf=np.ascontiguousarray(array))
        return DeviceArray(buffer, array.shape, array.dtype)

    def download(self, source: DeviceArray) -> NDArray[Any]:
        """Wait for an array and copy it to the host."""
        target, (_, copied) = self.start_download(source)
        copied.wait()
        return target

    def start_download(self, source: DeviceArray) -> tuple[NDArray[Any], Timer]:
        """Begin to copy an array to the host, where it is complete after the event."""
        target = np.empty(source.shape, source.dtype)
        if not target.size:
            return target, self._now()
        event = cl.enqueue_copy(self.queue, target, source.buffer, is_blocking=False)
        return target, (event, event)

    def fill(self, shape: tuple[int, ...], dtype: np.dtype[Any], value: float) -> DeviceArray:
        """Make a constant array on the device."""
        target = self.empty(shape, dtype)
        pattern = np.array([value], dtype)
        cl.enqueue_fill_buffer(
            self.queue, target.buffer, pattern, 0, max(target.nbytes, dtype.itemsize)
        )
        return target

    def prepare(
        self,
        node: Node,
        settings: Mapping[str, Any],
        sizes: Mapping[str, int],
        wanted: Wanted = EVERYTHING,
    ) -> Prepared:
        """Work out a node's launches over arrays of the given sizes.

        Outputs that are not wanted are left out if the node can do without them.
        """
        return Prepared(self, self.compile(node), settings, sizes, wanted)

    def finish(self) -> None:
        self.queue.finish()

    @property
    def buffers(self) -> int:
        """How many buffers were ever allocated: the pool hands back none."""
        return int(self.pool.active_blocks + self.pool.held_blocks)


def _converters(node: Node) -> dict[str, Convert]:
    """By parameter; empty for a node with a launch function, which passes its own."""
    if node.grid is None:
        return {}
    return {name: _converter(p.annotation) for name, p in node.parameters.items()}


def _converter(annotation: Any) -> Convert:
    """Numbers are passed as they are, tuples one by one, a choice by its index."""
    found = scalar_type(annotation)
    assert found is not None
    c_type, count, choices = found
    make = np.float32 if c_type == "float" else np.int32
    if choices:
        return lambda value: [np.int32(choices.index(value))]
    if count > 1:
        return lambda value: [make(v) for v in value]
    return lambda value: [make(value)]
