"""Patch verbs: how a variant says, in a line or two, where it differs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from tactograph.graph.errors import GraphError, did_you_mean
from tactograph.graph.files.flat_graph import PREVIOUS, Entry, Graph, split_previous
from tactograph.graph.files.strict_yaml import Place

Change = Mapping[str, Any]
Places = Mapping[str, Place]

_ALLOWED: dict[str, tuple[set[str], set[str]]] = {
    # verb: (required keys, optional keys)
    "set": ({"settings"}, set()),
    "replace": ({"op"}, {"inputs", "settings"}),
    "insert": ({"op"}, {"inputs", "settings", "after"}),
    "remove": (set(), set()),
    "backend": ({"to"}, set()),
    "neutral": (set(), set()),
}
_IN_FILE = {"inputs": "in", "settings": "with"}


def apply_patch(graph: Graph, change: Change, places: Places) -> Graph:
    """Return `graph` with one change made.

    Raises
    ------
    GraphError
        If the change has no verb or several, a key is missing or too many, or the node it
        speaks of is not there.
    """
    place = places[""]
    verbs = [verb for verb in _ALLOWED if verb in change]
    if len(verbs) != 1:
        raise GraphError(
            f"{place}: a change has exactly one of {', '.join(_ALLOWED)}; "
            f"this one has {' and '.join(verbs) or 'none'}"
        )
    verb = verbs[0]
    _check_keys(verb, set(change) - {verb}, place)
    target = str(change[verb])
    if verb == "insert" and target in graph.nodes:
        raise GraphError(f"{place}: insert: there is a node '{target}' already; give another name")
    if verb != "insert" and target not in graph.nodes:
        raise GraphError(
            f"{place}: {verb}: there is no node '{target}'{did_you_mean(target, graph.nodes)}"
        )
    return _VERBS[verb](graph, target, change, places)


def _check_keys(verb: str, given: set[str], place: Place) -> None:
    required, optional = _ALLOWED[verb]
    for key in sorted(required - given):
        raise GraphError(f"{place}: {verb} needs '{_IN_FILE.get(key, key)}'")
    for key in sorted(given - required - optional):
        raise GraphError(f"{place}: {verb} takes no '{_IN_FILE.get(key, key)}'")


def _set(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    entry = graph.nodes[target]
    settings = {**entry.settings, **change["settings"]}
    here = {
        key: places.get(key, places[""])
        for key in ("with", *(f"with.{name}" for name in change["settings"]))
    }
    entry = replace(entry, settings=settings, places={**entry.places, **here})
    return graph.with_entry(target, entry)


def _replace(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    entry = Entry(
        op=change["op"],
        inputs=change.get("inputs", graph.nodes[target].inputs),
        settings=change.get("settings", {}),
        places=places,
    )
    return graph.with_entry(target, entry)


def _insert(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    after = change.get("after")
    if after is not None:
        graph = _redirect(graph, after, target, places[""])
    entry = Entry(
        op=change["op"],
        inputs=change.get("inputs", {}),
        settings=change.get("settings", {}),
        places=places,
    )
    return graph.with_entry(target, entry)


def _redirect(graph: Graph, old: str, new: str, place: Place) -> Graph:
    # A node with one output is read by its name alone, or with the output's, which is the op.
    sole = f"{old}.{graph.nodes[old].op}" if old in graph.nodes else old

    def swap(reference: str) -> str:
        bare, previous = split_previous(reference)
        if bare not in (old, sole):
            return reference
        return f"{PREVIOUS}.{new}" if previous else new

    nodes = {
        node_id: replace(entry, inputs={port: swap(r) for port, r in entry.inputs.items()})
        for node_id, entry in graph.nodes.items()
    }
    outputs = {name: swap(reference) for name, reference in graph.outputs.items()}
    if nodes == graph.nodes and outputs == graph.outputs:
        raise GraphError(f"{place}: insert: after: {_why_unread(graph, old)}")
    return replace(graph, nodes=nodes, outputs=outputs)


def _why_unread(graph: Graph, reference: str) -> str:
    """Why no input and no output of the graph reads a reference."""
    node = reference.partition(".")[0]
    if node not in graph.nodes:
        return f"there is no node '{node}'{did_you_mean(node, graph.nodes)}"
    references = [r for entry in graph.nodes.values() for r in entry.inputs.values()]
    read = [r for r in (*references, *graph.outputs.values()) if r.partition(".")[0] == node]
    if not read:
        return f"nothing reads '{node}'"
    ports = ", ".join(f"'{port}'" for port in dict.fromkeys(read))
    return f"nothing reads '{reference}'; of this node {ports} can be named"


def _remove(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    nodes = {node_id: entry for node_id, entry in graph.nodes.items() if node_id != target}
    return replace(graph, nodes=nodes)


def _backend(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    entry = graph.nodes[target]
    here = {**entry.places, "backend": places["to"]}
    return graph.with_entry(target, replace(entry, backend=change["to"], places=here))


def _neutral(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    entry = graph.nodes[target]
    here = {**entry.places, "neutral": places["neutral"]}
    return graph.with_entry(target, replace(entry, neutral=True, places=here))


_VERBS: dict[str, Callable[[Graph, str, Change, Places], Graph]] = {
    "set": _set,
    "replace": _replace,
    "insert": _insert,
    "remove": _remove,
    "backend": _backend,
    "neutral": _neutral,
}
