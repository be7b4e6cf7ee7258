"""Sessions: files, windows and connections that a node keeps from item to item."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

T = TypeVar("T")


class Session:
    """The memory of one node of a pipeline, for objects that cannot flow along an edge.

    A node with a keyword-only argument of this type is handed one by the engine, the same
    for every item.  Plain values should come back by a `previous` edge instead.
    """

    def __init__(self) -> None:
        self._kept: list[Any] = []

    def keep(self, make: Callable[[], T]) -> T:
        """Return the result of the first call of `make`; it is closed with the pipeline."""
        if not self._kept:
            self._kept.append(make())
        kept: T = self._kept[0]
        return kept

    def close(self) -> None:
        """Close the kept object, if it has a ``close()``, and forget it."""
        while self._kept:
            close = getattr(self._kept.pop(), "close", None)
            if close is not None:
                close()
