"""The items of a source node, or of a caller's stream, which a thread may read ahead."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property, partial
from queue import SimpleQueue
from typing import Any, Generic, NamedTuple, TypeVar

from tactograph.graph.errors import collect_warnings, warn
from tactograph.graph.plan.draft import Task
from tactograph.graph.plan.plan import Plan
from tactograph.graph.run.node_errors import Blaming

Item = TypeVar("Item")
_NO_ITEM: Any = object()


class _Read(NamedTuple):
    """An item (None after the last), its warnings, the time it took to read, and its error."""

    item: Any
    notes: list[str]
    milliseconds: float
    error: Exception | None = None


class SourceStream:
    """The stream of a source node.

    If the node reads `ahead`, a thread reads the next item while the last one is in use.
    `milliseconds` is the time that the last item took to read.
    """

    def __init__(
        self, plan: Plan, source: Task, keywords: Mapping[str, Any], *, ahead: bool = True
    ) -> None:
        self._plan, self._source = plan, source
        self._ahead: list[_Read] = []
        self._in_thread = ahead and source.node.ahead
        self.milliseconds = 0.0
        with Blaming(plan, source):
            self._iterator: Iterator[Any] = iter(source.node(**keywords))

    def reads_two(self) -> bool:
        """Read the first two items ahead, and return whether both exist.

        `next` then returns them, with their warnings and errors.
        """
        self._ahead.append(self._read())
        if self._ahead[0].item is not None:
            self._ahead.append(self._read())
        return self._ahead[-1].item is not None

    def next(self) -> Any:
        """The next item, None after the last.  Raises TactographError if it cannot be read."""
        if self._ahead:
            read = self._ahead.pop(0)
        else:
            read = self._reader.next() if self._in_thread else self._read()
        for note in read.notes:
            warn(note)
        self.milliseconds = read.milliseconds
        if read.error is not None:
            raise read.error
        return read.item

    def close(self) -> None:
        """Stop the stream early."""
        if "_reader" in self.__dict__:
            self._reader.close(wait=True)
        close = getattr(self._iterator, "close", None)
        if close is not None:
            with Blaming(self._plan, self._source):
                close()

    @cached_property
    def _reader(self) -> ReadAhead[_Read]:
        return ReadAhead(self._read)

    def _read(self) -> _Read:
        notes: list[str] = []
        item, error, start = None, None, time.perf_counter()
        with collect_warnings(notes):
            try:
                with Blaming(self._plan, self._source):
                    item = next(self._iterator, None)
            except Exception as raised:
                error = raised
        return _Read(item, notes, 1e3 * (time.perf_counter() - start), error)


class ReadAhead(Generic[Item]):
    """Calls `read` in a thread while the item that it returned before is in use.

    The first call begins at once, each later call when the previous item is taken.  So at most one
    item waits, and it is at most as old as the processing of one item takes.
    """

    def __init__(self, read: Callable[[], Item]) -> None:
        self._read = read
        self._wanted: SimpleQueue[bool] = SimpleQueue()
        self._items_ahead: SimpleQueue[Item | BaseException] = SimpleQueue()
        # A daemon: a source that never returns must not keep the process alive.
        self._thread = threading.Thread(target=self._work, name="read", daemon=True)
        self._wanted.put(True)
        self._thread.start()

    def next(self) -> Item:
        """Return the next item, and begin to read the one after it.

        Raises what `read` raised, in the place of its item.
        """
        item = self._items_ahead.get()
        self._wanted.put(True)
        if isinstance(item, BaseException):
            raise item
        return item

    def close(self, *, wait: bool) -> None:
        """End the thread; with `wait`, return once it has read its present item."""
        self._wanted.put(False)
        if wait:
            self._thread.join()

    def _work(self) -> None:
        while self._wanted.get():
            try:
                self._items_ahead.put(self._read())
            except BaseException as error:
                self._items_ahead.put(error)


def in_thread(items: Iterator[Item]) -> Iterator[Item]:
    """Yield items; a thread reads each while the previous one is in use."""
    reader = ReadAhead(partial(next, items, _NO_ITEM))
    try:
        while (item := reader.next()) is not _NO_ITEM:
            yield item
    finally:
        reader.close(wait=False)
