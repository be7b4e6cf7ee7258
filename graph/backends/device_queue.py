"""One OpenCL device with an in-order queue and a pool of buffers.

Only a download waits.  A buffer returns to the pool after the last step that reads its value; on
an in-order queue its next owner cannot overtake that step.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pyopencl as cl
import pyopencl.tools
from numpy.typing import NDArray

from tactograph.graph.backends.arrays import (
    DeviceArray,
    Timer,
    bytes_for,
    global_size,
    in_lanes,
    local_size,
)
from tactograph.graph.backends.buffer_pool import BufferPool
from tactograph.graph.backends.devices import Device
from tactograph.graph.backends.kernel import Kernel
from tactograph.graph.backends.programs import build, context_of
from tactograph.graph.errors import InputError

if TYPE_CHECKING:
    from pyopencl.array import Array

_FRACTION_KERNEL = """
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


_serials = itertools.count(1)
SCALAR_PLATFORMS = ("rusticl",)
"""Platforms whose CPU compilers vectorise across work-items, and take ten times as long to build
kernels whose work-items process several elements."""


def usual_lanes(device: Device) -> int:
    """Return the number of elements that a work-item processes side by side on a device."""
    return 16 if device.kind == "CPU" and device.handle.platform.name not in SCALAR_PLATFORMS else 1


def usual_group(device: Device, lanes: int) -> int:
    """Return the number of work-items of a kernel that is a single work-group.

    More of them hide more of the memory's latency; the number was measured on NVIDIA devices only.
    """
    return 1 if lanes > 1 else 512 if "NVIDIA" in device.name else 128


def _array_class() -> type[Array]:
    """pyopencl's array class; imported here, since its module is slow and rarely needed."""
    from pyopencl.array import Array

    return Array


class Queue:
    """One OpenCL device with its queue and its buffers.

    `lanes` is the number of elements that a work-item processes side by side.  None chooses it for
    the device: most CPU compilers do not vectorise across work-items, and GPUs need one element
    each.
    `group` is the number of work-items of a kernel that is a single work-group.

    Attributes
    ----------
    error
        The exception type of the device's library.
    driver
        The driver's version; another version may give other numbers.
    serial
        Unique identifier of this device, and its compiled kernels, within the process.
    queue
        pyopencl's own queue, for arrays that a caller makes there.
    poison
        Value of every byte of a fresh buffer, in tests.
    """

    error: type[Exception] = cl.Error

    def __init__(self, device: Device, lanes: Literal[1, 16] | None = None) -> None:
        self.name = device.name
        self.driver = device.handle.driver_version
        self.serial = f"{device.name} {next(_serials)}"
        self.is_cpu = device.kind == "CPU"
        self.units = device.handle.max_compute_units
        self.lanes = lanes or usual_lanes(device)
        self.group = usual_group(device, self.lanes)
        self.context = context_of(device.handle)
        profiling = cl.command_queue_properties.PROFILING_ENABLE
        self.queue = cl.CommandQueue(self.context, properties=profiling)
        self.pool = BufferPool(pyopencl.tools.ImmediateAllocator(self.queue), cl.MemoryError)
        self.poison: int | None = None
        self._fractions: dict[int, Kernel] = {}
        self.options = ["-cl-std=CL1.2"]
        correctly_rounded = cl.device_fp_config.CORRECTLY_ROUNDED_DIVIDE_SQRT
        if device.handle.single_fp_config & correctly_rounded:
            self.options.append("-cl-fp32-correctly-rounded-divide-sqrt")

    def empty(self, shape: tuple[int, ...], dtype: np.dtype[Any]) -> DeviceArray:
        """Take a buffer from the pool; an empty array still gets some bytes to point at.

        With `poison` set, every byte of it holds that value, so that a test detects an element
        that a kernel failed to write.
        """
        return self.take(bytes_for(shape, dtype), shape, dtype)

    def take(self, nbytes: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> DeviceArray:
        """Like `empty`, with the result of `bytes_for`."""
        memory = self.pool.take(nbytes)
        if self.poison is not None:
            # A copy, not a fill: oclgrind takes filled buffers for uninitialised ones.
            cl.enqueue_copy(self.queue, memory.buffer, np.full(nbytes, self.poison, np.uint8))
        return DeviceArray(memory, shape, dtype)

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
        event = self.send(array, target)
        return target, (event, event)

    def send(self, array: NDArray[Any], to: DeviceArray) -> cl.Event:
        """Begin to copy a host array, which must not change before the event, to a buffer."""
        source = np.ascontiguousarray(array)
        return cl.enqueue_copy(self.queue, to.buffer, source, is_blocking=False)

    def start_upload_of_fraction(self, array: NDArray[Any]) -> tuple[DeviceArray, Timer]:
        """Begin to copy unsigned integers and convert them there to fractions of full scale.

        8 bits are a quarter of the bytes of float32.  The values equal those made on the host.
        """
        source, (started, _) = self.start_upload(array)
        target = self.empty(array.shape, np.dtype(np.float32))
        full = np.float32(np.iinfo(array.dtype).max)
        kernel = self._fraction(array.dtype.itemsize)
        local = local_size(1, self.lanes)
        work_items = global_size(in_lanes(array.shape, self.lanes), local)
        arguments = (source.buffer, target.buffer, np.int32(array.size), full)
        return target, (started, kernel.bind(self.queue, work_items, local, arguments)())

    def _now(self) -> Timer:
        marker = cl.enqueue_marker(self.queue)
        return marker, marker

    def _fraction(self, size: int) -> Kernel:
        """The kernel of `start_upload_of_fraction` for integers of one or two bytes."""
        if size not in self._fractions:
            macros = f"-DLANES={self.lanes}", f"-DWHOLE={'uchar' if size == 1 else 'ushort'}"
            program = build(self.context, _FRACTION_KERNEL, (*self.options, *macros))
            self._fractions[size] = Kernel(cl.Kernel(program, "fraction"))
        return self._fractions[size]

    def copied(self, source: DeviceArray) -> DeviceArray:
        """Copy an array on the device."""
        target = self.empty(source.shape, source.dtype)
        self._copy(source.buffer, target, 0)
        return target

    def _copy(self, source: Any, target: DeviceArray, offset: int) -> None:
        if count := target.nbytes:
            cl.enqueue_copy(
                self.queue, target.buffer, source, byte_count=count, src_offset=offset
            ).wait()

    def lent(self, array: DeviceArray) -> Array:
        """A pyopencl array, whose memory returns to the pool with its last view."""
        # Views of an array refer only to its buffer, so the buffer has to keep the memory.
        buffer: Any = cl.Buffer.from_int_ptr(array.buffer.int_ptr)
        buffer.memory = array.memory
        return _array_class()(self.queue, array.shape, array.dtype, data=buffer)

    def mapped(self, array: Array, name: str) -> NDArray[Any]:
        """A pyopencl array for the host, which on a CPU reads it in place.

        Raises
        ------
        InputError
            If it belongs to another context, or is not contiguous.
        """
        if not isinstance(array, _array_class()) or array.context != self.context:
            raise InputError(
                f"{name} belongs to another OpenCL context; make it with pipeline.queue, "
                "or pass array.get()"
            )
        if not array.flags.c_contiguous:
            raise InputError(f"{name} is not contiguous; pass array.copy()")
        array.finish()
        view: NDArray[Any] = array.map_to_host(self.queue, cl.map_flags.READ)
        return view

    def adopted(self, array: Array) -> DeviceArray:
        """A mapped array, read in place; it is copied if it begins within its buffer."""
        buffer: Any = array.base_data
        nbytes = bytes_for(array.shape, array.dtype)
        if array.offset == 0 and buffer.size >= nbytes:
            return DeviceArray(self.pool.own(buffer), array.shape, array.dtype)
        target = self.empty(array.shape, array.dtype)
        self._copy(buffer, target, array.offset)
        return target

    def constant(self, array: NDArray[Any]) -> DeviceArray:
        """Copy a host array to a buffer of its own, outside the pool."""
        if not array.size:
            return self.empty(array.shape, array.dtype)
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
        buffer = cl.Buffer(self.context, flags, hostbuf=np.ascontiguousarray(array))
        return DeviceArray(self.pool.own(buffer), array.shape, array.dtype)

    def download(self, source: DeviceArray) -> NDArray[Any]:
        """Wait for an array and copy it to the host."""
        target, (_, copied) = self.start_download(source)
        copied.wait()
        return target

    def start_download(self, source: DeviceArray) -> tuple[NDArray[Any], Timer]:
        """Begin to copy an array to the host; it is complete after the event."""
        target = np.empty(source.shape, source.dtype)
        if not target.size:
            return target, self._now()
        event = cl.enqueue_copy(self.queue, target, source.buffer, is_blocking=False)
        return target, (event, event)

    def fill(self, shape: tuple[int, ...], dtype: np.dtype[Any], value: float) -> DeviceArray:
        """Make a constant array on the device."""
        target = self.empty(shape, dtype)
        pattern = np.array([value], dtype)
        nbytes = max(target.nbytes, dtype.itemsize)
        cl.enqueue_fill_buffer(self.queue, target.buffer, pattern, 0, nbytes)
        return target

    def finish(self) -> None:
        self.queue.finish()

    def has_failed(self, timer: Timer) -> bool:
        """Return whether the operation between two events ended in an error."""
        try:
            return any(event.command_execution_status < 0 for event in timer)
        except cl.Error:
            return True

    def milliseconds(self, timer: Timer) -> float:
        """The time between the start of the first event and the end of the last, on the device."""
        first, last = timer
        # Twice as fast as the attribute `profile`.
        start: Any = first.get_profiling_info(cl.profiling_info.START)
        end: Any = last.get_profiling_info(cl.profiling_info.END)
        return float(end - start) * 1e-6

    @property
    def buffers(self) -> int:
        """The number of buffers in the pool, which frees none unless memory runs out."""
        return self.pool.count
