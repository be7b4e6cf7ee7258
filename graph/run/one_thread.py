"""A pipeline's turn: one thread at a time may use it."""

import threading

from tactograph.graph.errors import InputError


class Turn:
    """Lets one thread at a time into a pipeline, and none once it is closed.

    No thread waits for the lock, which costs less than a microsecond an item.
    """

    __slots__ = ("_closed", "_lock", "_name")

    def __init__(self, name: str) -> None:
        self._name = name
        self._lock = threading.Lock()
        self._closed = False

    def __enter__(self) -> None:
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
                f"{self._name}: the pipeline is at work already; it belongs to one thread, so "
                "load one for each"
            )
