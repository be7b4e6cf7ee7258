"""What `before` asks of networkx, in lists that can be kept as JSON."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import networkx as nx
from networkx.utils import UnionFind

Listed = Mapping[str, list[str]]
"""Names with those that come before each, in the same order in every process."""


def in_order(before: Listed, ranks: Mapping[str, Any]) -> list[str]:
    """Sort names by what comes before them, then by rank."""
    return list(nx.lexicographical_topological_sort(_dag(before), key=ranks.__getitem__))


def with_all_before(before: Listed, names: list[str]) -> list[str]:
    """Return the names with all that come before them."""
    dag = _dag(before)
    return sorted({*names}.union(*(nx.ancestors(dag, name) for name in names)))


def find_cycle(before: Listed) -> list[str]:
    """Return a cycle, from a name back to itself; [] if there is none."""
    try:
        cycle = nx.find_cycle(_dag(before))
    except nx.NetworkXNoCycle:
        return []
    return [cycle[0][0], *(edge[1] for edge in cycle)]


def classes_of(count: int, pairs: Iterable[tuple[int, int]]) -> list[int]:
    """Return a number of the class of each of `count` numbers, of which pairs are in one class."""
    classes: UnionFind[int] = UnionFind(range(count))
    for pair in pairs:
        classes.union(*pair)
    return [classes[number] for number in range(count)]


def _dag(before: Listed) -> nx.DiGraph[str]:
    """The graph with an edge to each name from all that come before it."""
    dag: nx.DiGraph[str] = nx.DiGraph()
    dag.add_nodes_from(before)
    dag.add_edges_from((first, name) for name, firsts in before.items() for first in firsts)
    return dag
