"""Sort names by what has to come before each: ``{"b": {"a"}}`` if b reads a.

Answers are kept on disk for later processes: importing networkx takes 0.1 s and 12 MiB.
"""

import json
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence, Set as AbstractSet
from typing import Any, TypeVar

from tactograph.graph.disk.disk_cache import cached_file, read_cached, write_cached

Before = Mapping[str, AbstractSet[str]]
Name = TypeVar("Name", bound=Hashable)
MAX_KEPT_BYTES = 10**7
"""Largest size of all answers on disk, those for some hundred graphs."""


def in_order(before: Before, rank: Callable[[str], Any] = str) -> list[str]:
    """Sort names: each behind all that come before it, otherwise by rank, lowest first.

    No two names may have the same rank.
    """
    ranks = {name: rank(name) for name in sorted({*before}.union(*before.values()))}
    return list(_answer("in_order", _listed(before), ranks))


def with_all_before(before: Before, names: Iterable[str]) -> set[str]:
    """Return the names with all that come before them, directly or indirectly."""
    return {*_answer("with_all_before", _listed(before), sorted(names))}


def find_cycle(before: Before) -> list[str]:
    """Return a cycle, from a name back to itself; [] if there is none."""
    return list(_answer("find_cycle", _listed(before)))


def classes_of(names: Sequence[Name], alike: Iterable[tuple[Name, Name]]) -> dict[Name, Name]:
    """Return one name for each class of names that pairs join, directly or indirectly."""
    number = {name: index for index, name in enumerate(names)}
    pairs = [(number[one], number[other]) for one, other in alike]
    firsts = _answer("classes_of", len(names), pairs)
    return {name: names[first] for name, first in zip(names, firsts, strict=True)}


def _listed(before: Before) -> dict[str, list[str]]:
    return {name: sorted(firsts) for name, firsts in before.items()}


def _answer(question: str, *of: Any) -> Any:
    """The answer of a function of `_walks`, from disk if another process has asked."""
    file = cached_file("plans", question, of)
    if file is not None and (cached := read_cached(file)) is not None:
        return json.loads(cached)
    from tactograph.graph.plan import _walks

    answer = getattr(_walks, question)(*of)
    if file is not None:
        write_cached(file, json.dumps(answer).encode(), MAX_KEPT_BYTES)
    return answer
