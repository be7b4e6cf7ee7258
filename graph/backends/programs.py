"""OpenCL programs, each built once per process.

A build takes hundreds of times as long as a launch.  Programs belong to a context, so all queues of
a device share one.  PoCL and NVIDIA's driver keep binaries on disk, but still parse each source
(PoCL in 60 ms); binaries kept here load in a fifteenth of that.  For other drivers, pyopencl or the
driver keeps them.  PoCL compiles every kernel of a program to return a binary: set
PYOPENCL_NO_CACHE=1 if only few kernels are launched.
"""

import os
import warnings
from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import pyopencl as cl

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

from tactograph.graph.backends.pocl_cache import SPECIALISE_VARIABLE
from tactograph.graph.backends.pocl_source import pocl_binary, pocl_source
from tactograph.graph.disk.disk_cache import cached_file, can_be_written, read_cached, write_cached

Recipe = tuple[str, tuple[str, ...]]
"""A program's source and options."""
MAX_PROGRAMS = 64
"""Largest number of built programs that a process keeps."""
ahead: deque[Recipe] = deque(maxlen=MAX_PROGRAMS)
"""Programs that will be needed."""
MAX_PROGRAM_BYTES = 2 * 10**8
"""Largest size of all programs on disk, some two thousand programs."""
LOCK_DIGITS = 12
"""Digits of a program's key that choose its byte of the file of locks."""
POCL_PLATFORM = "Portable Computing Language"
POCL_OF_BINARIES = "PoCL 3.1"
"""The version whose binaries `pocl_binary` knows."""
CACHED_PLATFORMS = (POCL_PLATFORM, "NVIDIA CUDA")
"""Platforms whose programs are kept on disk here."""


@cache
def context_of(handle: cl.Device) -> cl.Context:
    """The context of all queues of a device."""
    return cl.Context([handle])


@lru_cache(MAX_PROGRAMS)
def build(context: cl.Context, source: str, options: tuple[str, ...]) -> cl.Program:
    """Build a source, or return the program that was built of it earlier.

    If another process is building it, this one builds programs that are `ahead`, then waits.

    Raises
    ------
    cl.RuntimeError
        If it does not compile.
    """
    file = _cache_file(context.devices[0], source, options)
    if file is None:
        return _compiled(context, source, options)
    while (binary := _from_disk(context, file, options)) is None:
        with suppress(BlockingIOError), _alone(file, wait=not ahead):
            return _from_disk(context, file, options) or _onto_disk(context, source, options, file)
        with suppress(IndexError):  # another thread took it
            build_if_free(context, *ahead.popleft())
    return binary


def build_if_free(context: cl.Context, source: str, options: tuple[str, ...]) -> None:
    """Build a source for the disk, unless it exists or another process is building it.

    A source that does not compile without constants of its launch is left to the launch,
    and its compiler's errors are not printed.
    """
    file = _cache_file(context.devices[0], source, options)
    if file is None or file.exists():
        return
    with suppress(BlockingIOError, cl.RuntimeError), _alone(file, wait=False):
        if file.exists():
            return
        with silent_stderr():
            _onto_disk(context, source, options, file)


def start_compiler(context: cl.Context) -> None:
    """Have PoCL load its compiler, which takes as long as a program, once per process."""
    _compiled(context, "__kernel void nothing(void) {}", ())


def is_ready(device: cl.Device, source: str, options: tuple[str, ...]) -> bool:
    """Return whether building a source for the disk would gain nothing."""
    file = _cache_file(device, source, options)
    return fcntl is None or file is None or file.exists() or not can_be_written(file.parent)


def _from_disk(context: cl.Context, file: Path, options: tuple[str, ...]) -> cl.Program | None:
    binary, version = read_cached(file), context.devices[0].platform.version
    if binary and POCL_OF_BINARIES in version and os.environ.get(SPECIALISE_VARIABLE) == "0":
        binary = pocl_binary(binary)
    with suppress(cl.Error):  # the driver does not take it any more
        if binary:
            return _built(cl.Program(context, context.devices, [binary]), options)
    return None


def _onto_disk(
    context: cl.Context, source: str, options: tuple[str, ...], file: Path
) -> cl.Program:
    try:
        program = _compiled(context, source, options)
    except cl.RuntimeError:
        write_cached(file, b"")  # nothing is gained by another try ahead of its launch
        raise
    binaries: Any = program.get_info(cl.program_info.BINARIES)
    write_cached(file, binaries[0], MAX_PROGRAM_BYTES)
    return program


@contextmanager
def _alone(file: Path, *, wait: bool = True) -> Iterator[None]:
    """Keep other processes from building the same program, if files can be locked.

    Raises
    ------
    BlockingIOError
        If another process is building it, and is not waited for.
    """
    with ExitStack() as stack:
        if fcntl is not None:
            # One file for all programs, with a byte for each, so there are no lock files to remove.
            place = int(file.name[:LOCK_DIGITS], 16)
            try:
                file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
                lock = stack.enter_context((file.parent / "lock").open("ab"))
                fcntl.lockf(lock, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB), 1, place)
            except BlockingIOError:
                raise
            except OSError:  # a folder that cannot be written; two may build the same then
                pass
        yield


def _compiled(context: cl.Context, source: str, options: tuple[str, ...]) -> cl.Program:
    if context.devices[0].platform.name == POCL_PLATFORM:
        text, more = pocl_source(source)
        with suppress(cl.RuntimeError):  # another version's file may say it otherwise
            return _built(cl.Program(context, text), (*options, *more))
    return _built(cl.Program(context, source), options)


def _built(program: cl.Program, options: tuple[str, ...]) -> cl.Program:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # compilers' remarks on their own speed
        program.build(options=list(options))
    return program


def _cache_file(device: cl.Device, source: str, options: tuple[str, ...]) -> Path | None:
    """The file for a binary; None if binaries are not kept."""
    unwanted = os.environ.get("PYOPENCL_NO_CACHE", "0") != "0"
    if unwanted or device.platform.name not in CACHED_PLATFORMS:
        return None
    return cached_file(
        "programs", device.platform.name, device.platform.version, device.name, device.version,
        device.driver_version, source, options, os.environ.get("PYOPENCL_BUILD_OPTIONS"),
    )  # fmt: skip


@contextmanager
def silent_stderr() -> Iterator[None]:
    """Keep a compiler from printing to the terminal, which bypasses Python's streams."""
    stderr_copy, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    os.close(nowhere)
    try:
        yield
    finally:
        os.dup2(stderr_copy, 2)
        os.close(stderr_copy)
