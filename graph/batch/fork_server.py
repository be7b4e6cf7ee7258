"""The process that a batch's processes are forked from: it imports what they need, once for all."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import forkserver, resource_tracker
from typing import Any, TypeVar

from tactograph import ctrl_c
from tactograph.graph.run.cores import cores, environment, share_of, take_over

Given = TypeVar("Given")
SAFE_PATH = {"PYTHONSAFEPATH": "1"}
"""Helpers start as ``python -c``, which would import from the working folder first."""

PARENT_VARIABLE = "TACTOGRAPH_PARENT"
"""The environment variable that tells the server whom it is for."""


def start_importing() -> bool:
    """Start the server: it imports while this process goes on.  Return if this system has one."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        # What is started instead starts whenever there is something to do.
        os.environ.update(SAFE_PATH)
        return False
    multiprocessing.set_forkserver_preload(["tactograph.graph.batch.imported_ahead"])
    with environment({**share_of(cores()), **SAFE_PATH, PARENT_VARIABLE: str(os.getpid())}):
        # Else the server starts it, and unblocks Ctrl-C for that.
        resource_tracker.ensure_running()
        # Blocked here, it is for the server and all that it forks.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            forkserver.ensure_running()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    return True


def start_processes(number: int) -> ProcessPoolExecutor:
    """Start processes with a share of the cores each: forked from the server where there is one.

    A fork of this process would copy an OpenCL context, which no runtime allows.  They end with
    this process, however that ends, and leave Ctrl-C to it: see `stop_processes`.
    """
    share = share_of(number)
    context = multiprocessing.get_context("forkserver" if start_importing() else "spawn")
    return ProcessPoolExecutor(number, context, initializer=_begin, initargs=(share,))


def hand_over(
    processes: ProcessPoolExecutor, do: Callable[..., Given], *about: Any
) -> Future[Given]:
    """Have one of the processes do something.

    Should one be started for it, Ctrl-C waits for that: one that starts behind its parent's end
    would say so at length.
    """
    with ctrl_c.later():
        return processes.submit(do, *about)


def stop_processes() -> None:
    """Have every process that was started here end what it does, at once."""
    for process in multiprocessing.active_children():
        process.terminate()


def _begin(share: Mapping[str, str]) -> None:
    """What a process does first."""
    take_over(share)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    # What is half written is removed on the way out.  Last, for until then there is nothing.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))


def _end_with_parent() -> None:
    """Killed, a parent ends nobody; but its end of a pipe is closed."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
