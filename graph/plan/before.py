"""Orders of names, by what comes before each: ``{"b": {"a"}}`` where b reads a."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Set as AbstractSet
from graphlib import CycleError, TopologicalSorter
from heapq import heappop, heappush
from typing import Any

Before = Mapping[str, AbstractSet[str]]


def in_order(before: Before, rank: Callable[[str], Any] = str) -> list[str]:
    """Sort names: each behind what comes before it, and those of low rank first.

    Ranks of different names differ.
    """
    sorter = TopologicalSorter(before)
    sorter.prepare()
    free: list[tuple[Any, str]] = []
    ordered: list[str] = []
    while sorter.is_active():
        for name in sorter.get_ready():
            heappush(free, (rank(name), name))
        ordered.append(heappop(free)[1])
        sorter.done(ordered[-1])
    return ordered


def with_all_before(before: Before, names: Iterable[str]) -> set[str]:
    """Find the names, what comes before them, and what before that."""
    found: set[str] = set()
    ahead = list(names)
    while ahead:
        name = ahead.pop()
        if name not in found:
            found.add(name)
            ahead.extend(before[name])
    return found


def find_cycle(before: Before) -> list[str]:
    """Find a cycle from a name back to itself; [] if there is none."""
    try:
        TopologicalSorter(before).prepare()
    except CycleError as error:
        cycle: list[str] = error.args[1]
        return cycle
    return []
