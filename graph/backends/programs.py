"""OpenCL programs, each built once a process.

Building one takes hundreds of times what a launch takes.  Programs belong to a context, so all
queues of a device share one.  PoCL keeps binaries on disk, but reads the source of each program
all the same (60 ms), so what it built is kept here too, and taken in a fifteenth of the time.
Of other drivers pyopencl, or the driver itself, keeps them.  To give a binary away, PoCL compiles
every kernel a second time: PYOPENCL_NO_CACHE=1 is for who builds a program only once.
"""

from __future__ import annotations

import hashlib
import os
import warnings
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import pyopencl as cl

from tactograph.graph.disk.disk_cache import SUFFIX, cache_folder, read_cached, write_cached

MAX_PROGRAMS = 64
"""Of so many programs a process keeps what was built."""
MAX_PROGRAM_BYTES = 2 * 10**8
"""Of what is kept on disk: some two thousand programs."""
POCL_PLATFORM = "Portable Computing Language"
"""The platform whose programs are kept on disk here."""


@cache
def context_of(handle: cl.Device) -> cl.Context:
    """The context of all queues of a device."""
    return cl.Context([handle])


@lru_cache(MAX_PROGRAMS)
def build(context: cl.Context, source: str, options: tuple[str, ...]) -> cl.Program:
    """Build a source, or return what was built of it before.

    Raises
    ------
    cl.RuntimeError
        If it does not compile.
    """
    file = _kept(context.devices[0], source, options)
    binary = None if file is None else read_cached(file)
    if binary is not None:
        try:
            return _built(cl.Program(context, context.devices, [binary]), options)
        except cl.Error:
            pass  # the driver does not take it any more
    program = _built(cl.Program(context, source), options)
    if file is not None:
        binaries: Any = program.get_info(cl.program_info.BINARIES)
        write_cached(file, binaries[0], MAX_PROGRAM_BYTES)
    return program


def _built(program: cl.Program, options: tuple[str, ...]) -> cl.Program:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # compilers' remarks on their own speed
        program.build(options=list(options))
    return program


def _kept(device: cl.Device, source: str, options: tuple[str, ...]) -> Path | None:
    """Where the binary is kept; None if it is not."""
    folder = cache_folder()
    unwanted = os.environ.get("PYOPENCL_NO_CACHE", "0") != "0"
    if folder is None or unwanted or device.platform.name != POCL_PLATFORM:
        return None
    of = (
        device.platform.name, device.platform.version, device.name, device.version,
        device.driver_version, source, options, os.environ.get("PYOPENCL_BUILD_OPTIONS"),
    )  # fmt: skip
    key = hashlib.blake2b(repr(of).encode(), digest_size=16).hexdigest()
    return folder / "programs" / f"{key}{SUFFIX}"
