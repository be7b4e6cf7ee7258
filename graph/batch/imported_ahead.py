"""Modules of a batch's processes that take long to import and start no lasting thread."""

import os
import threading

from tactograph.graph.batch.fork_server import PARENT_VARIABLE
from tactograph.graph.run.collect_seldom import collect_seldom

collect_seldom()

POLL_INTERVAL_S = 0.2
"""Time between two looks whether the parent still runs."""
_imported = threading.Event()


def _end_with(parent: int) -> None:
    """End as soon as the parent has ended: it may be killed during the imports."""
    while os.getppid() == parent:
        if _imported.wait(POLL_INTERVAL_S):
            return
    os._exit(1)


_watch = threading.Thread(
    target=_end_with, args=(int(os.environ.get(PARENT_VARIABLE, os.getppid())),)
)
_watch.start()

import cv2  # noqa: E402, F401

import tactograph.graph.backends.launch  # noqa: E402
import tactograph.graph.batch.worker  # noqa: E402, F401

_imported.set()
_watch.join()
