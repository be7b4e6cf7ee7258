"""Sort names by what has to come before each: ``{"b": {"a"}}`` if b reads a."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Set as AbstractSet
from typing import Any

import networkx as nx

Before = Mapping[str, AbstractSet[str]]


def in_order(before: Before, rank: Callable[[str], Any] = str) -> list[str]:
    """Sort names: each behind all that come before it, otherwise by rank, lowest first.

    No two names may have the same rank.
    """
    return list(nx.lexicographical_topological_sort(_dag(before), key=rank))


def with_all_before(before: Before, names: Iterable[str]) -> set[str]:
    """Return the names with all that come before them, directly or indirectly."""
    dag, names_before = _dag(before), set(names)
    return names_before.union(*(nx.ancestors(dag, name) for name in names_before))


def find_cycle(before: Before) -> list[str]:
    """Return a cycle, from a name back to itself; [] if there is none."""
    try:
        cycle = nx.find_cycle(_dag(before))
    except nx.NetworkXNoCycle:
        return []
    return [cycle[0][0], *(edge[1] for edge in cycle)]


def _dag(before: Before) -> nx.DiGraph[str]:
    """The graph with an edge to each name from all that come before it."""
    dag: nx.DiGraph[str] = nx.DiGraph()
    dag.add_nodes_from(before)
    dag.add_edges_from((first, name) for name, firsts in before.items() for first in firsts)
    return dag
