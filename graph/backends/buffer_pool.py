"""Buffers on one device, lent and taken back.

Of those that are free the one of the lowest number is lent first.  An item of a stream takes
and returns what the item before did, so each launch gets the buffers that it had before, and
can be enqueued again as it was (see `Prepared`).
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Callable
from heapq import heappop, heappush
from typing import Any

Free = list[tuple[int, Any]]
"""A heap of the buffers of one size that nobody holds, by number."""
SIZE_STEP_BITS = 4
"""Buffers come in sizes of 2^SIZE_STEP_BITS steps from each power of two to the next."""


class Memory:
    """A buffer on loan: it returns to its pool when nobody holds this any more.

    `number` is its own as long as the device lives.
    """

    __slots__ = ("_free", "buffer", "number")

    def __init__(self, buffer: Any, number: int, free: Free | None = None) -> None:
        self.buffer, self.number, self._free = buffer, number, free

    # As a default, since a module's names may be gone when the interpreter ends.
    def __del__(self, push: Callable[[Free, tuple[int, Any]], None] = heappush) -> None:
        if self._free is not None:
            push(self._free, (self.number, self.buffer))


class BufferPool:
    """What `allocate` made, by size; it raises `exhausted` if the device has no more.

    Nothing here waits: on an in-order queue the next owner of a buffer cannot overtake the last.

    Attributes
    ----------
    count, nbytes
        Of all buffers that there are, lent or free.
    """

    def __init__(self, allocate: Callable[[int], Any], exhausted: type[Exception]) -> None:
        self._allocate, self._exhausted = allocate, exhausted
        self._free: defaultdict[int, Free] = defaultdict(list)
        self._numbers = itertools.count()
        self.count = self.nbytes = 0

    def take(self, nbytes: int) -> Memory:
        """Lend a buffer of so many bytes, or a few more.

        Raises
        ------
        Exception
            The pool's `exhausted`, if even what is free here does not suffice.
        """
        size = _rounded(nbytes)
        free = self._free[size]
        if free:
            number, buffer = heappop(free)
            return Memory(buffer, number, free)
        try:
            buffer = self._allocate(size)
        except self._exhausted:
            self._give_back()
            buffer = self._allocate(size)
        self.count += 1
        self.nbytes += size
        return Memory(buffer, next(self._numbers), free)

    def own(self, buffer: Any) -> Memory:
        """A number for a buffer that was made elsewhere, and never comes here."""
        return Memory(buffer, next(self._numbers))

    def _give_back(self) -> None:
        """Return to the device what nobody holds."""
        for size, free in self._free.items():
            self.count -= len(free)
            self.nbytes -= size * len(free)
            free.clear()


def _rounded(nbytes: int) -> int:
    """The size of the buffer that so many bytes are lent in."""
    shift = max(nbytes.bit_length() - SIZE_STEP_BITS - 1, 0)
    return -(-nbytes >> shift) << shift
