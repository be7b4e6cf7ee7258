"""The process that a batch's processes are forked from: it imports what they need, once for all."""

from __future__ import annotations

import multiprocessing
from multiprocessing import forkserver
from multiprocessing.context import BaseContext

from tactograph.graph.run.cores import cores, environment, share_of

IMPORTED = ["tactograph.graph.batch.worker", "tactograph.graph.backends.launch", "cv2"]
"""What takes long to import and starts no thread."""


def start_importing() -> bool:
    """Start the server: it imports while this process goes on.  Return if this system has one."""
    if not _has_server():
        return False
    multiprocessing.set_forkserver_preload(IMPORTED)
    with environment(share_of(cores())):
        forkserver.ensure_running()
    return True


def process_context() -> BaseContext:
    """How processes start: forked from the server, or anew where a system has none.

    A fork of this process would copy an OpenCL context, which no runtime allows.
    """
    return multiprocessing.get_context("forkserver" if start_importing() else "spawn")


def _has_server() -> bool:
    return "forkserver" in multiprocessing.get_all_start_methods()
