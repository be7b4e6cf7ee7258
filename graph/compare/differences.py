"""The differences between two graphs, node by node: what exactly was ablated."""

from collections.abc import Iterable, Iterator, Mapping
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


MAX_APART = 3
"""Boxes, outputs or params that one graph alone has and that are told one by one."""


def differences(base: Graph, other: Graph, *, every: bool = False) -> list[Difference]:
    """The changes that turn `base` into `other`: box by box, or of `every` node.

    A box is a node, or the outermost use of a group with all its nodes.
    """
    gone = {n: entry for n, entry in base.nodes.items() if n not in other.nodes}
    changes = [Difference(n, "removed", _described(entry), "") for n, entry in gone.items()]
    for node_id, entry in other.nodes.items():
        if node_id not in base.nodes:
            changes.append(Difference(node_id, "added", "", _described(entry)))
        elif base.nodes[node_id].op != entry.op and not every:
            before = _described(base.nodes[node_id])
            changes.append(Difference(node_id, "op", before, _described(entry)))
        else:
            changes += _changed(node_id, base.nodes[node_id], entry)
    if not every:
        changes = _joined(_by_box(base, other, changes))
    outputs = list(_mapping("outputs", "", base.outputs, other.outputs))
    defaults = [{n: p.default for n, p in graph.params.items()} for graph in (base, other)]
    params = list(_mapping("params", "default of ", *defaults))
    changes += outputs + params if every else _names_of(outputs) + _names_of(params)
    if base.prefer != other.prefer:
        changes.append(Difference("prefer", "", ", ".join(base.prefer), ", ".join(other.prefer)))
    return changes


def _by_box(base: Graph, other: Graph, changes: Iterable[Difference]) -> Iterator[Difference]:
    """The differences, those inside an outermost use in one if they are many."""
    boxes: dict[str, list[Difference]] = {}
    for change in changes:
        boxes.setdefault(box_around(change.node, {**base.uses, **other.uses}), []).append(change)
    for box, inside in boxes.items():
        if box == inside[0].node:
            yield from inside
            continue
        size, new_size = (len(_nodes_of(graph, box)) for graph in (base, other))
        if not new_size:
            yield Difference(box, "removed", f"{base.uses[box].group}: {size} nodes", "")
        elif not size:
            yield Difference(box, "added", "", f"{other.uses[box].group}: {new_size} nodes")
        elif len(inside) <= MAX_APART:
            yield from inside
        else:
            before, after = (_inside(box, inside, *pair) for pair in ((base, other), (other, base)))
            yield Difference(box, f"{len(inside)} changes", before, after)


def _nodes_of(graph: Graph, box: str) -> list[str]:
    return [name for name in graph.nodes if name == box or name.startswith(f"{box}.")]


def _inside(box: str, changes: Iterable[Difference], graph: Graph, against: Graph) -> str:
    """The nodes of a box that differ, with their ops where those do."""
    lines = []
    for node in dict.fromkeys(change.node for change in changes):
        if node in graph.nodes:
            op, name = graph.nodes[node].op, node.removeprefix(f"{box}.")
            same = node in against.nodes and against.nodes[node].op == op
            lines.append(name if same else f"{name}: {op}")
    return ", ".join(lines)


def _joined(changes: Iterable[Difference]) -> list[Difference]:
    """The differences, the boxes that one graph alone has in one if they are many."""
    changes = list(changes)
    for change in ("removed", "added"):
        alone = [each for each in changes if each.change == change]
        if len(alone) > MAX_APART:
            names, count = ", ".join(each.node for each in alone), f"{len(alone)} boxes"
            before, after = ("", count) if change == "added" else (count, "")
            rest = [each for each in changes if each.change != change]
            changes = [Difference(names, change, before, after), *rest]
    return changes


def _names_of(changes: list[Difference]) -> list[Difference]:
    """Differences of outputs or params, by name alone if they are many."""
    if len(changes) <= MAX_APART:
        return changes
    names = ", ".join(each.change.removeprefix("default of ") for each in changes)
    return [Difference(changes[0].node, names, "", f"{len(changes)} differ")]


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
        was, is_ = (_shown(side, key) for side in (before, after))
        if was != is_:
            yield Difference(node_id, f"{prefix}{key}", was, is_)


def _shown(mapping: Mapping[str, Any], key: str) -> str:
    return str(mapping[key]) if key in mapping else "not set"


def _described(entry: Entry) -> str:
    settings = ", ".join(f"{name}={value}" for name, value in entry.settings.items())
    return f"{entry.op}({settings})" if settings else entry.op


def _yes(value: bool) -> str:
    return "yes, by its neutral value" if value else "no"
