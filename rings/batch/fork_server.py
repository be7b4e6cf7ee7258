"""The process that a batch's processes are forked from: it imports their modules once for all."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import forkserver, resource_tracker
from types import FrameType
from typing import Any, TypeVar

from tactograph.sdk import Graph, RunOptions, cores

Answer = TypeVar("Answer")
MIN_CAPTURES_PER_PROCESS = 256
"""Captures that justify the start of a process, which takes a second."""
SAFE_PATH = {"PYTHONSAFEPATH": "1"}
"""The setting for helpers: as ``python -c`` they would import from the working folder first."""
LIBRARY_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "POCL_MAX_PTHREAD_COUNT",
    "POCL_CPU_MAX_CU_COUNT",
)
"""The variables that limit the threads of libraries and of PoCL."""

LOADER_VARIABLE = "PYOPENCL_HOME"
"""Set by `pyopencl` when it is imported; its loader crashes without it."""


class Terminated(SystemExit):
    """Raised where SIGTERM ends a process of a batch: no node is to blame."""


def worker_count(graph: Graph, options: RunOptions, captures: int) -> int:
    """The number of processes that finish soonest.

    It is one for each core, since separate processes outrun shared threads, and one for a GPU.

    Raises InputError if the options name no device that works.
    """
    device, _ = options.open_device(graph)
    return at_most(captures) if device is None or device.is_cpu else 1


def at_most(captures: int) -> int:
    """The upper limit of that, for any graph."""
    return max(1, min(cores(), captures // MIN_CAPTURES_PER_PROCESS))


def share_of(workers: int) -> int:
    """The share that each worker gets of this process' cores."""
    return max(1, cores() // workers)


def limited_to(share: int) -> dict[str, str]:
    """The environment of a worker of so many cores.  Variables that the user has set stay."""
    return {**dict.fromkeys(LIBRARY_VARIABLES, str(share)), **os.environ}


@contextmanager
def environment(values: Mapping[str, str]) -> Iterator[None]:
    """Give these variables to the processes that are started inside the block."""
    before = dict(os.environ)
    take_over(values)
    try:
        yield
    finally:
        take_over(before)


def take_over(values: Mapping[str, str]) -> None:
    """Replace the environment."""
    for name in {*os.environ} - {*values}:
        del os.environ[name]
    os.environ.update(values)


def start_importing() -> bool:
    """Start the server, which imports meanwhile; return whether this system has one."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        # Without a server, processes start when there is work.
        os.environ.update(SAFE_PATH)
        return False
    multiprocessing.set_forkserver_preload(["tactograph.rings.batch.imported_ahead"])
    with environment({**limited_to(1), **SAFE_PATH}):
        # Else the server would start the tracker, and unblock Ctrl-C for that.
        resource_tracker.ensure_running()
        # Blocked here, Ctrl-C is blocked in the server and in all that it forks.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return True


def start_processes(number: int, set_up: Callable[[], object] = int) -> ProcessPoolExecutor:
    """Start processes with a share of the cores each: forked from the server where there is one.

    A fork of this process would copy an OpenCL context, which no runtime allows.  The processes end
    with this one, however it ends, and leave Ctrl-C to it: see `stop_processes`.
    """
    share = share_of(number)
    about = share, limited_to(share), set_up
    context = multiprocessing.get_context("forkserver" if start_importing() else "spawn")
    return ProcessPoolExecutor(number, context, initializer=_begin, initargs=about)


def hand_over(
    processes: ProcessPoolExecutor, do: Callable[..., Answer], *about: Any
) -> Future[Answer]:
    """Call a function in one of the processes.

    Ctrl-C waits while a process starts: one that starts after its parent's end prints a long
    traceback.
    """
    with ctrl_c_later():
        return processes.submit(do, *about)


@contextmanager
def ctrl_c_later() -> Iterator[None]:
    """Let Ctrl-C wait for the end of the block; only the main thread ever hears of it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    signals: list[tuple[int, FrameType | None]] = []
    before = signal.signal(signal.SIGINT, lambda *about: signals.append(about))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if signals and callable(before):
        before(*signals[0])


def stop_processes() -> None:
    """End every process that was started here, at once."""
    for process in multiprocessing.active_children():
        process.terminate()


def _begin(share: int, limits: Mapping[str, str], set_up: Callable[[], object]) -> None:
    """Set up a process; what it is forked from has imported `pyopencl`."""
    home = os.environ.get(LOADER_VARIABLE)
    take_over({**({} if home is None else {LOADER_VARIABLE: home}), **limits})
    cores(at_most=share)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    set_up()
    # On the way out half-written files are removed.  Set last: until then there are none.
    signal.signal(signal.SIGTERM, _terminate)


def _terminate(number: int, _: object) -> None:
    raise Terminated(128 + number)


def _end_with_parent() -> None:
    """End with the parent: a killed one ends no child, but its end of a pipe closes."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
