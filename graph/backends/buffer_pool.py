"""A pool of buffers on one device.

The free buffer with the lowest number is lent first.  So an item of a stream uses the same buffers
as the previous item, and each launch can be enqueued again unchanged (see `Prepared`).
"""

import itertools
from collections import defaultdict
from collections.abc import Callable
from functools import lru_cache
from heapq import heappop, heappush
from typing import Any

Free = list[tuple[int, Any]]
"""A heap of the free buffers of one size, by number."""
SIZE_STEP_BITS = 4
"""Buffer sizes divide the span between two powers of two into 2^SIZE_STEP_BITS steps."""


class Memory:
    """A buffer on loan, which returns to its pool when this object is freed.

    `number` identifies it for the life of the device.
    """

    __slots__ = ("_free", "buffer", "number")

    def __init__(self, buffer: Any, number: int, free: Free | None = None) -> None:
        self.buffer, self.number, self._free = buffer, number, free

    # A default argument, since a module's names may be gone when the interpreter exits.
    def __del__(self, push: Callable[[Free, tuple[int, Any]], None] = heappush) -> None:
        if self._free is not None:
            push(self._free, (self.number, self.buffer))


class BufferPool:
    """Buffers made by `allocate`, by size; it raises `exhausted` if the device has no more memory.

    No call waits: on an in-order queue the next owner of a buffer cannot overtake the last.

    Attributes
    ----------
    count, nbytes
        Number and bytes of all buffers, lent or free.
    """

    def __init__(self, allocate: Callable[[int], Any], exhausted: type[Exception]) -> None:
        self._allocate, self._exhausted = allocate, exhausted
        self._free: defaultdict[int, Free] = defaultdict(list)
        self._numbers = itertools.count()
        self.count = self.nbytes = 0

    def take(self, nbytes: int) -> Memory:
        """Lend a buffer of at least `nbytes`.

        Raises
        ------
        Exception
            The pool's `exhausted`, if there is too little memory even without the free buffers.
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
        """Number a buffer that was made elsewhere and never enters the pool."""
        return Memory(buffer, next(self._numbers))

    def _give_back(self) -> None:
        """Return the free buffers to the device."""
        for size, free in self._free.items():
            self.count -= len(free)
            self.nbytes -= size * len(free)
            free.clear()


@lru_cache(maxsize=1024)
def _rounded(nbytes: int) -> int:
    """The buffer size for a request of `nbytes`."""
    shift = max(nbytes.bit_length() - SIZE_STEP_BITS - 1, 0)
    return -(-nbytes >> shift) << shift
