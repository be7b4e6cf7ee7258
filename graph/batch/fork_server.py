"""The process that a batch's processes are forked from: it imports their modules once for all."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import forkserver, resource_tracker
from typing import Any, TypeVar

from tactograph import ctrl_c
from tactograph.graph.cores import cores, environment, share_of, take_over
from tactograph.graph.errors import Terminated

Answer = TypeVar("Answer")
SAFE_PATH = {"PYTHONSAFEPATH": "1"}
"""The setting for helpers: as ``python -c`` they would import from the working folder first."""


def start_importing() -> bool:
    """Start the server, which imports meanwhile; return whether this system has one."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        # Without a server, processes start when there is work.
        os.environ.update(SAFE_PATH)
        return False
    multiprocessing.set_forkserver_preload(["tactograph.graph.batch.imported_ahead"])
    with environment({**share_of(cores()), **SAFE_PATH}):
        # Else the server would start the tracker, and unblock Ctrl-C for that.
        resource_tracker.ensure_running()
        # Blocked here, Ctrl-C is blocked in the server and in all that it forks.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return True


def start_processes(number: int) -> ProcessPoolExecutor:
    """Start processes with a share of the cores each: forked from the server where there is one.

    A fork of this process would copy an OpenCL context, which no runtime allows.  The processes end
    with this one, however it ends, and leave Ctrl-C to it: see `stop_processes`.
    """
    share = share_of(number)
    context = multiprocessing.get_context("forkserver" if start_importing() else "spawn")
    return ProcessPoolExecutor(number, context, initializer=_begin, initargs=(share,))


def hand_over(
    processes: ProcessPoolExecutor, do: Callable[..., Answer], *about: Any
) -> Future[Answer]:
    """Call a function in one of the processes.

    Ctrl-C waits while a process starts: one that starts after its parent's end prints a long
    traceback.
    """
    with ctrl_c.later():
        return processes.submit(do, *about)


def stop_processes() -> None:
    """End every process that was started here, at once."""
    for process in multiprocessing.active_children():
        process.terminate()


def _begin(share: Mapping[str, str]) -> None:
    """Set up a process."""
    take_over(share)
    threading.Thread(target=_end_with_parent, daemon=True).start()
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
