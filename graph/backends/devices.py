"""List OpenCL devices, and trust none before it has run a real kernel.

Some runtimes list a CPU and then cannot compile for it.  So each candidate compiles and runs a
small kernel, and its verdict states why it is not used.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tactograph.graph.backends import intel_runtime, pocl_cache
from tactograph.graph.errors import InputError, NotBuiltError, did_you_mean

if TYPE_CHECKING:
    import pyopencl as cl

NOT_IN_A_FORK = (
    "OpenCL was used before this process was forked, and no runtime works in a fork; start "
    "processes by 'spawn' or 'forkserver' (DataLoader: multiprocessing_context=\"spawn\"), or use "
    'backend="numpy" here'
)
_PROBE_KERNEL = """
__kernel void probe(__global const float *a, __global float *out, const float b)
{
    const int i = get_global_id(0);
    __local float shared_[64];
    shared_[get_local_id(0)] = a[i];
    barrier(CLK_LOCAL_MEM_FENCE);
    out[i] = sqrt(shared_[63 - get_local_id(0)]) + b;
}
"""


@dataclass(frozen=True)
class Device:
    """An OpenCL device with the probe's verdict."""

    name: str
    kind: str
    handle: cl.Device
    works: bool
    verdict: str
    simulator: bool


def find_devices() -> list[Device]:
    """List and probe every device; return an empty list if there is no OpenCL."""
    return [_probed(handle) for handle in _handles()]


def choose_device(text: str | None = None, *, waits: bool = True) -> tuple[Device | None, str]:
    """Return the device to use, or None and the reason.

    Parameters
    ----------
    text
        A part of the device's or platform's name; None chooses the first that works, GPUs
        first.  Simulators are chosen only by name: they are made for tests, not for speed.
    waits
        Whether the caller waits if the compiler has to be started first.

    Raises
    ------
    NotBuiltError
        If the caller does not wait, and no program is built for the first device yet.
    InputError
        If `text` matches no device, or only devices that do not work, or in a fork of a process
        that has asked for devices.
    """
    handles = list(_handles())
    if text is not None:
        named = [h for h in handles if text.lower() in _name(h).lower()]
        if not named:
            names = [_name(h) for h in handles]
            raise InputError(
                f"no OpenCL device's name contains '{text}'{did_you_mean(text, names)} "
                f"(devices: {'; '.join(names) or 'none'})"
            )
        probed = [_probed(h) for h in named]
        working = [d for d in probed if d.works]
        if not working:
            raise InputError(f"device {probed[0].name}: {probed[0].verdict}")
        return working[0], ""
    reasons = []
    for handle in handles:
        if _is_simulator(handle):
            continue
        if not (waits or _has_probe(handle)):
            raise NotBuiltError("no kernel is built for it yet")
        device = _probed(handle)
        if device.works:
            return device, ""
        reasons.append(f"{device.name}: {device.verdict}")
    refused = f" ({'; '.join(reasons)})" if reasons else " here"
    return None, f"no OpenCL device works{refused}; {how_to_get_one()}"


def how_to_get_one() -> str:
    """What gives this system an OpenCL device for its CPU."""
    for variable in (
        ("XDG_CACHE_HOME", pocl_cache.CACHE_VARIABLE) if sys.platform == "linux" else ()
    ):
        if folder := pocl_cache.unwritable_folder(variable):
            return f"{folder}, for drivers' programs, cannot be written to: set {variable}=FOLDER"
    if sys.platform == "darwin":
        return "macOS includes one; conda install -c conda-forge pyopencl pocl adds another"
    if intel_runtime.is_for_this_system():
        return 'for one: pip install "tactograph[cpu]"'
    if Path("/etc/debian_version").exists():
        return "for one: apt-get install pocl-opencl-icd"
    return "for one: conda install -c conda-forge pyopencl pocl"


@cache
def _first_process() -> int:
    """The process that first asked for devices; a fork inherits the cached number."""
    return os.getpid()


def _handles() -> Iterator[cl.Device]:
    if _first_process() != os.getpid():
        raise InputError(NOT_IN_A_FORK)
    if pocl_cache.unwritable_folder():
        # PyOpenCL fails where it cannot keep its programs.
        os.environ.setdefault("PYOPENCL_NO_CACHE", "1")
    try:
        import pyopencl as cl
    except ImportError:
        return
    pocl_cache.compile_once()
    pocl_cache.heed_crashes()
    try:
        with intel_runtime.listed():
            platforms = cl.get_platforms()
    except cl.Error:
        return
    handles = []
    for platform in platforms:
        try:
            handles += platform.get_devices()
        except cl.Error:
            continue
    gpu = cl.device_type.GPU
    # Loaders list drivers in arbitrary order; sorted by name, Intel's comes first.
    yield from sorted(handles, key=lambda h: (0, "") if h.type & gpu else (1, h.platform.name))


def _name(handle: cl.Device) -> str:
    return f"{handle.platform.name.strip()} / {handle.name.strip()}"


def _is_simulator(handle: cl.Device) -> bool:
    return "oclgrind" in handle.platform.name.lower()


def _probed(handle: cl.Device) -> Device:
    import pyopencl as cl

    kinds = {"GPU": cl.device_type.GPU, "CPU": cl.device_type.CPU}
    kind = next((name for name, bit in kinds.items() if handle.type & bit), "other")
    simulator = _is_simulator(handle)
    try:
        trouble = _run_probe(handle)
    except (cl.Error, RuntimeError) as error:
        trouble = (str(error).strip() or type(error).__name__).splitlines()[0]
    verdict = trouble or ("works; a simulator, taken only by name" if simulator else "works")
    return Device(_name(handle), kind, handle, trouble is None, verdict, simulator)


def _has_probe(handle: cl.Device) -> bool:
    """Return whether the probe's kernel is built; it is always built first."""
    from tactograph.graph.backends.programs import is_ready

    return is_ready(handle, _PROBE_KERNEL, ())


@cache
def _run_probe(handle: cl.Device) -> str | None:
    """Compile and run a small kernel, once per process; return what is wrong, or None."""
    import pyopencl as cl

    from tactograph.graph.backends.build_ahead import begin_helpers
    from tactograph.graph.backends.programs import POCL_PLATFORM, build, context_of

    if handle.platform.name == POCL_PLATFORM:
        pocl_cache.note_crash()
    if not _has_probe(handle):
        begin_helpers(handle)
    context = context_of(handle)
    queue = cl.CommandQueue(context)
    kernel = cl.Kernel(build(context, _PROBE_KERNEL, ()), "probe")
    a = np.arange(128, dtype=np.float32)
    flags = cl.mem_flags
    source = cl.Buffer(context, flags.READ_ONLY | flags.COPY_HOST_PTR, hostbuf=a)
    target = cl.Buffer(context, flags.WRITE_ONLY, a.nbytes)
    kernel(queue, (128,), (64,), source, target, np.float32(1))
    result = np.empty_like(a)
    cl.enqueue_copy(queue, result, target)
    expected = np.sqrt(a.reshape(2, 64)[:, ::-1].ravel()) + np.float32(1)
    if not np.allclose(result, expected, rtol=1e-6):
        return "a test kernel ran but gave wrong numbers"
    return None
