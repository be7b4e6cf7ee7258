"""The process that a batch's processes are forked from: it imports what they need, once for all."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import forkserver

from tactograph.graph.run.cores import cores, environment, share_of, take_over


def start_importing() -> bool:
    """Start the server: it imports while this process goes on.  Return if this system has one."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return False
    multiprocessing.set_forkserver_preload(["tactograph.graph.batch.imported_ahead"])
    with environment(share_of(cores())):
        forkserver.ensure_running()
    return True


def start_processes(number: int) -> ProcessPoolExecutor:
    """Start processes with a share of the cores each: forked from the server where there is one.

    A fork of this process would copy an OpenCL context, which no runtime allows.
    """
    context = multiprocessing.get_context("forkserver" if start_importing() else "spawn")
    return ProcessPoolExecutor(number, context, initializer=take_over, initargs=(share_of(number),))
