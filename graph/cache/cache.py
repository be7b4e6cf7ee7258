"""Results of nodes in this process, by key, so that equal work is done once."""

import sys
import threading
from collections import OrderedDict
from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, NamedTuple

import numpy as np

from tactograph.graph.backends.arrays import DeviceArray
from tactograph.graph.backends.device_backend import DeviceBackend, open_device
from tactograph.graph.plan.sizes import Shapes

Side = Literal["host", "device"]
MAX_MEGABYTES = 512
"""Default limit on the memory of a cache's values, on host and device together."""
MAX_RUNS = 20_000
"""Largest number of runs whose shapes, time and warnings a cache remembers."""
_ENTRY_BYTES = 500
"""Overhead of a value; an empty array still has a buffer."""
_OBJECT_BYTES = 2**23
"""Assumed size of an object other than an array."""


class CacheKey(NamedTuple):
    """A kept output of a node's run: the run's key, the port, and its side (host or device)."""

    run: str
    port: str
    side: Side


@dataclass(frozen=True)
class Run:
    """Shapes, time and warnings of a node's run."""

    shapes: Shapes
    milliseconds: float
    warnings: tuple[str, ...]


class Cache:
    """Results of nodes up to a limit of memory; the least recently used are dropped first.

    Pipelines of one thread may share it: ``load("a.yaml", cache=cache)``.  They then also
    share the device, its compiled kernels and its buffers.

    Parameters
    ----------
    megabytes
        Limit on the memory of all values, on host and device together.
    """

    def __init__(self, megabytes: float = MAX_MEGABYTES) -> None:
        self.most = int(megabytes * 1e6)
        self.bytes = 0
        self._values: OrderedDict[CacheKey, tuple[Any, int]] = OrderedDict()
        self._runs: OrderedDict[str, Run] = OrderedDict()
        self._opened = lru_cache(open_device)
        self._lock = threading.RLock()

    def __len__(self) -> int:
        return len(self._values)

    def __contains__(self, key: CacheKey) -> bool:
        return key in self._values

    def take(self, key: CacheKey) -> Any:
        """A value that is in the cache."""
        with self._lock:
            self._values.move_to_end(key)
            return self._values[key][0]

    def put(self, key: CacheKey, value: Any) -> None:
        """Keep a value, unless it alone is too large."""
        size = _ENTRY_BYTES + _bytes(value)
        if size > self.most:
            return
        with self._lock:
            self.drop(key)
            self._values[key] = value, size
            self.bytes += size
            while self.bytes > self.most:
                self.drop(next(iter(self._values)))

    def drop(self, key: CacheKey) -> None:
        """Forget a value, if it is there."""
        with self._lock:
            _, size = self._values.pop(key, (None, 0))
            self.bytes -= size

    def run(self, key: str) -> Run | None:
        """Shapes, time and warnings of a run, or None."""
        with self._lock:
            if key in self._runs:
                self._runs.move_to_end(key)
            return self._runs.get(key)

    def note(self, key: str, run: Run) -> None:
        """Remember a run."""
        with self._lock:
            self._runs[key] = run
            if len(self._runs) > MAX_RUNS:
                self._runs.popitem(last=False)

    def device(
        self, backends: Collection[str], text: str | None
    ) -> tuple[DeviceBackend | None, str]:
        """The device for a graph, shared by all graphs that use it; see `open_device`."""
        return self._opened(tuple(backends), text)


def _bytes(value: Any) -> int:
    """The memory of a value; an estimate for objects other than arrays."""
    if isinstance(value, np.ndarray | DeviceArray):
        return int(value.nbytes)
    if isinstance(value, dict):
        return 100 + sum(_bytes(each) for pair in value.items() for each in pair)
    if isinstance(value, tuple | list):
        return 100 + sum(map(_bytes, value))
    plain = value is None or isinstance(value, bool | int | float | str | bytes)
    return sys.getsizeof(value) if plain else _OBJECT_BYTES
