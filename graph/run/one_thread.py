"""Let only one thread at a time use a pipeline."""

import os
import threading

from tactograph.graph.backends.devices import NOT_IN_A_FORK
from tactograph.graph.errors import InputError


class Turn:
    """Admits one thread at a time to a pipeline, and none once it is closed.

    A second thread is refused; it never waits.  The lock costs less than a microsecond an item.
    A pipeline on a device also refuses a fork of its process, which lacks the device's threads.
    """

    __slots__ = ("_closed", "_lock", "_name", "_process")

    def __init__(self, name: str, *, on_device: bool) -> None:
        self._name = name
        self._process = os.getpid() if on_device else None
        self._lock = threading.Lock()
        self._closed = False

    def __enter__(self) -> None:
        if self._process not in (None, os.getpid()):
            raise InputError(f"{self._name}: {NOT_IN_A_FORK}")
        self._take()
        if self._closed:
            self._lock.release()
            raise InputError(f"{self._name}: the pipeline was closed; load the graph again")

    def __exit__(self, *_: object) -> None:
        self._lock.release()

    def end(self) -> bool:
        """Close the pipeline to all threads; return whether it was open."""
        self._take()
        was_open, self._closed = not self._closed, True
        self._lock.release()
        return was_open

    def _take(self) -> None:
        if not self._lock.acquire(blocking=False):
            raise InputError(
                f"{self._name}: another thread is using the pipeline; load one pipeline for each "
                "thread"
            )
