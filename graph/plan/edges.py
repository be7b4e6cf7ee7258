"""Ways along the edges of a graph: what lies before a node, a cycle, an order.

`Edges` maps each node to those right before it.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Mapping
from graphlib import CycleError, TopologicalSorter
from typing import Any

Edges = Mapping[str, Iterable[str]]


def reachable(edges: Edges, start: Iterable[str]) -> set[str]:
    """The nodes of `start` and all that lie before them."""
    found: set[str] = set()
    waiting = list(start)
    while waiting:
        node = waiting.pop()
        if node not in found:
            found.add(node)
            waiting += edges.get(node, ())
    return found


def turned(edges: Edges) -> dict[str, list[str]]:
    """The same edges, from each node to those right behind it."""
    behind: dict[str, list[str]] = {node: [] for node in edges}
    for node, before in edges.items():
        for each in before:
            behind[each].append(node)
    return behind


def find_cycle(edges: Edges) -> list[str] | None:
    """The nodes of a cycle in the direction of its edges, the first once more at the end."""
    try:
        TopologicalSorter(edges).prepare()
    except CycleError as error:
        cycle: list[str] = error.args[1]
        return cycle
    return None


def in_order(edges: Edges, rank: Callable[[str], Any]) -> list[str]:
    """Every node behind those before it; of those that may come next, the one of lowest rank."""
    sorter = TopologicalSorter(edges)
    sorter.prepare()
    ready: list[tuple[Any, str]] = []
    order: list[str] = []
    while sorter.is_active():
        for node in sorter.get_ready():
            heapq.heappush(ready, (rank(node), node))
        _, node = heapq.heappop(ready)
        order.append(node)
        sorter.done(node)
    return order
