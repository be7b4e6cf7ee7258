"""The items of a source node, the first of which may be read ahead."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from typing import Any

from tactograph.graph.errors import collect_warnings, warn
from tactograph.graph.plan.draft import Task
from tactograph.graph.run.node_errors import Blaming


class SourceStream:
    """The stream of a source node, begun with settings of its own.

    Attributes
    ----------
    milliseconds
        Time that the last item took.
    """

    def __init__(self, source: Task, keywords: Mapping[str, Any]) -> None:
        self._source = source
        self._notes: list[str] = []
        self._error: Exception | None = None
        self._ahead: list[tuple[Any, float]] = []
        self.milliseconds = 0.0
        with Blaming(source):
            self._iterator: Iterator[Any] = iter(source.node(**keywords))

    def read_ahead(self, count: int = 1) -> int:
        """Read the first items now; `next` gives them, their warnings and an error, if any.

        Returns
        -------
        The number of items, `count` at most.
        """
        try:
            with collect_warnings(self._notes):
                self._ahead += ((self._read(), self.milliseconds) for _ in range(count))
        except Exception as error:
            self._error = error
        return sum(item is not None for item, _ in self._ahead)

    def next(self) -> Any:
        """The next item, None after the last.

        Raises
        ------
        TactographError
            If it cannot be read.
        """
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        for note in self._notes:
            warn(note)
        self._notes = []
        if not self._ahead:
            return self._read()
        item, self.milliseconds = self._ahead.pop(0)
        return item

    def close(self) -> None:
        """End the stream before its end."""
        close = getattr(self._iterator, "close", None)
        if close is not None:
            with Blaming(self._source):
                close()

    def _read(self) -> Any:
        start = time.perf_counter()
        with Blaming(self._source):
            item = next(self._iterator, None)
        self.milliseconds = 1e3 * (time.perf_counter() - start)
        return item
