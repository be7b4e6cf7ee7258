"""Orders of names, by what comes before each: ``{"b": {"a"}}`` where b reads a."""

from collections.abc import Callable, Iterable, Mapping, Set as AbstractSet
from graphlib import CycleError, TopologicalSorter
from heapq import heappop, heappush
from typing import Any

Before = Mapping[str, AbstractSet[str]]


def in_order(before: Before, rank: Callable[[str], Any] = str) -> list[str]:
    """Sort names: each behind what comes before it, and those of low rank first.

    Ranks of different names differ.
    """
    names = TopologicalSorter(before)
    names.prepare()
    waiting: list[tuple[Any, str]] = []
    ordered: list[str] = []
    while names.is_active():
        for name in names.get_ready():
            heappush(waiting, (rank(name), name))
        _, name = heappop(waiting)
        names.done(name)
        ordered.append(name)
    return ordered


def with_all_before(before: Before, names: Iterable[str]) -> set[str]:
    """Find the names, what comes before them, and what before that."""
    found: set[str] = set()
    waiting = [*names]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting.extend(before.get(name, ()))
    return found


def find_cycle(before: Before) -> list[str]:
    """Find a cycle from a name back to itself; [] if there is none."""
    try:
        TopologicalSorter(before).prepare()
    except CycleError as error:
        cycle: list[str] = error.args[1]
        return cycle
    return []
