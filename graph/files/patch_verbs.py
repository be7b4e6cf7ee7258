"""The patch verbs: what each does to one node of a graph."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from tactograph.graph.declare.ports import RESTING_INPUT
from tactograph.graph.disk.strict_yaml import Place
from tactograph.graph.errors import GraphError, did_you_mean
from tactograph.graph.files.flat_graph import (
    PREVIOUS_ITEM,
    Entry,
    Graph,
    split_previous,
    split_reference,
)

Change = Mapping[str, Any]
Places = Mapping[str, Place]


def _set(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    entry = graph.nodes[target]
    values, reads = change.get("settings", {}), change.get("inputs", {})
    here = {
        key: places.get(key, places[""])
        for key in (*(f"with.{name}" for name in values), *(f"in.{port}" for port in reads))
    }
    if values:
        here["with"] = places.get("with", places[""])
    inputs = {p: r for p, r in {**entry.inputs, **reads}.items() if r is not None}
    settings = {**entry.settings, **values}
    return graph.with_changed(target, here, inputs=inputs, settings=settings)


def _replace(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    own = {"inputs": graph.nodes[target].inputs, **change}
    return graph.with_entry(target, entry_of(own, places))


def _insert(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    if change.get("after") is not None:
        graph = redirect(graph, change["after"], target, places[""])
    return graph.with_entry(target, entry_of(change, places))


def entry_of(change: Change, places: Places) -> Entry:
    inputs, settings = change.get("inputs", {}), change.get("settings", {})
    return Entry(op=change["op"], inputs=inputs, settings=settings, places=places)


def redirect(graph: Graph, old: str, new: str, place: Place) -> Graph:
    # A node with one output is read as NODE or as NODE.OP: its output has the name of the op.
    sole = f"{old}.{graph.nodes[old].op}" if old in graph.nodes else old
    changed = with_references(graph, lambda r: new if r in (old, sole) else r)
    if (changed.nodes, changed.uses, changed.outputs) == (graph.nodes, graph.uses, graph.outputs):
        raise GraphError(f"{place}: insert: after: {_why_unread(graph, old)}")
    return changed


def with_references(graph: Graph, changed: Callable[[str], str]) -> Graph:
    """Change every reference of the graph, to this and to the previous item."""

    def swap(reference: str) -> str:
        bare, previous = split_previous(reference)
        return f"{PREVIOUS_ITEM}.{changed(bare)}" if previous else changed(bare)

    def swapped(inputs: Mapping[str, str]) -> dict[str, str]:
        # `else` names a node, not one of its outputs.
        return {p: r if p == RESTING_INPUT else swap(r) for p, r in inputs.items()}

    return replace(
        graph,
        nodes={n: replace(entry, inputs=swapped(entry.inputs)) for n, entry in graph.nodes.items()},
        uses={n: replace(use, inputs=swapped(use.inputs)) for n, use in graph.uses.items()},
        outputs=swapped(graph.outputs),
    )


def _why_unread(graph: Graph, reference: str) -> str:
    """Why no input or output of the graph reads a reference."""
    node, _ = split_reference(reference, graph.nodes)
    if node not in graph.nodes:
        return f"there is no node '{node}'{did_you_mean(node, graph.nodes)}"
    references = [split_previous(r)[0] for e in graph.nodes.values() for r in e.inputs.values()]
    references += graph.outputs.values()
    read = [r for r in references if split_reference(r, graph.nodes)[0] == node]
    if not read:
        return f"nothing reads '{node}'"
    ports = ", ".join(f"'{port}'" for port in dict.fromkeys(read))
    return f"nothing reads '{reference}'; of this node {ports} can be named"


def _remove(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    return graph.without([target], places[""])


def _backend(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    return graph.with_changed(target, {"backend": places["to"]}, backend=change["to"])


def _neutral(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    return graph.with_changed(target, {"neutral": places["neutral"]}, neutral=True)


VERB_FUNCTIONS: dict[str, Callable[[Graph, str, Change, Places], Graph]] = {
    "set": _set,
    "replace": _replace,
    "insert": _insert,
    "remove": _remove,
    "backend": _backend,
    "neutral": _neutral,
}


def verb_of(change: Change) -> str:
    """Return the verb of a change, which must have one."""
    return next(verb for verb in VERB_FUNCTIONS if verb in change)
