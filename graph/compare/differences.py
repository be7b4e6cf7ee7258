"""The differences between two graphs, node by node: what exactly was ablated."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from tactograph.graph.files.flat_graph import Entry, Graph
from tactograph.graph.show.sketch import box_around


@dataclass(frozen=True)
class Difference:
    """A difference between two graphs: its place, and both values."""

    node: str
    change: str
    before: str
    after: str


def differences(base: Graph, other: Graph) -> dict[str, list[Difference]]:
    """The changes that turn `base` into `other`, by box, then those of the graphs themselves.

    A box is a node, or the outermost use of a group with all its nodes.
    """
    removed = {n: entry for n, entry in base.nodes.items() if n not in other.nodes}
    changes = [Difference(n, "removed", _described(entry), "") for n, entry in removed.items()]
    for node_id, entry in other.nodes.items():
        if node_id not in base.nodes:
            changes.append(Difference(node_id, "added", "", _described(entry)))
        else:
            changes += _changed(node_id, base.nodes[node_id], entry)
    defaults = [{n: p.default for n, p in graph.params.items()} for graph in (base, other)]
    changes += _mapping("outputs", "", base.outputs, other.outputs)
    changes += _mapping("params", "default of ", *defaults)
    if base.prefer != other.prefer:
        changes.append(Difference("prefer", "", ", ".join(base.prefer), ", ".join(other.prefer)))
    boxes: dict[str, list[Difference]] = {}
    for change in changes:
        boxes.setdefault(box_around(change.node, {**base.uses, **other.uses}), []).append(change)
    return boxes


def _changed(node_id: str, before: Entry, after: Entry) -> Iterator[Difference]:
    if before.op != after.op:
        yield Difference(node_id, "op", before.op, after.op)
    if before.neutral != after.neutral:
        yield Difference(node_id, "taken out", _yes(before.neutral), _yes(after.neutral))
    if before.backend != after.backend:
        was, is_ = before.backend or "as preferred", after.backend or "as preferred"
        yield Difference(node_id, "back end", was, is_)
    yield from _mapping(node_id, "input ", before.inputs, after.inputs)
    yield from _mapping(node_id, "", before.settings, after.settings)


def _mapping(
    node_id: str, prefix: str, before: Mapping[str, Any], after: Mapping[str, Any]
) -> Iterator[Difference]:
    for key in dict.fromkeys([*before, *after]):
        was, is_ = (str(side.get(key, "not set")) for side in (before, after))
        if was != is_:
            yield Difference(node_id, f"{prefix}{key}", was, is_)


def _described(entry: Entry) -> str:
    settings = ", ".join(f"{name}={value}" for name, value in entry.settings.items())
    return f"{entry.op}({settings})" if settings else entry.op


def _yes(value: bool) -> str:
    return "yes, by its neutral value" if value else "no"
