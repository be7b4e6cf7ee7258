"""What a node keeps from item to item: a file, a window, a connection."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")


class Session:
    """The memory of one node of a pipeline, for things that cannot flow along an edge.

    A node with a keyword-only argument of this type is handed one by the engine, the same
    for every item.  Plain values should rather come back by a `previous` edge.
    """

    def __init__(self) -> None:
        self._kept: list[Any] = []

    def keep(self, make: Callable[[], T]) -> T:
        """Return what `make` made at the first call; it is closed with the pipeline."""
        if not self._kept:
            self._kept.append(make())
        kept: T = self._kept[0]
        return kept

    def close(self) -> None:
        """Call ``close()`` of what is kept, if it has one, and forget it."""
        while self._kept:
            close = getattr(self._kept.pop(), "close", None)
            if close is not None:
                close()
