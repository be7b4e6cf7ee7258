"""OpenCL programs, each built once a process.

A build takes hundreds of times as long as a launch.  Programs belong to a context, so all queues of
a device share one.  PoCL keeps binaries on disk, but still parses each source (60 ms), so binaries
are kept here too, which takes a fifteenth of that.  For other drivers, pyopencl or the driver keeps
them.  PoCL compiles every kernel of a program to hand out a binary: set PYOPENCL_NO_CACHE=1 where
few of them are launched.
"""

from __future__ import annotations

import hashlib
import os
import warnings
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import pyopencl as cl

from tactograph.graph.disk.disk_cache import KEPT_SUFFIX, cache_folder, read_cached, write_cached

MAX_PROGRAMS = 64
"""Built programs that a process keeps."""
MAX_PROGRAM_BYTES = 2 * 10**8
"""Bytes of programs on disk: some two thousand programs."""
POCL_PLATFORM = "Portable Computing Language"
"""The platform whose programs are kept on disk here."""


@cache
def context_of(handle: cl.Device) -> cl.Context:
    """The context of all queues of a device."""
    return cl.Context([handle])


@lru_cache(MAX_PROGRAMS)
def build(context: cl.Context, source: str, options: tuple[str, ...]) -> cl.Program:
    """Build a source, or return the program that was built of it before.

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
    """The file for a binary; None where binaries are not kept."""
    folder = cache_folder()
    unwanted = os.environ.get("PYOPENCL_NO_CACHE", "0") != "0"
    if folder is None or unwanted or device.platform.name != POCL_PLATFORM:
        return None
    origin = (
        device.platform.name, device.platform.version, device.name, device.version,
        device.driver_version, source, options, os.environ.get("PYOPENCL_BUILD_OPTIONS"),
    )  # fmt: skip
    key = hashlib.blake2b(repr(origin).encode(), digest_size=16).hexdigest()
    return folder / "programs" / f"{key}{KEPT_SUFFIX}"
