"""Patch verbs: how a variant says, in a line or two, where it differs.

A change speaks of a node of the flat graph (``save``, ``pass_2.label``), of a use of a group
(``pass_2``), of a group (``pass``), or of a node of a group (``pass.label``), which is the same
change in every use.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from tactograph.graph.errors import GraphError, did_you_mean
from tactograph.graph.files.flat_graph import (
    PREVIOUS,
    Entry,
    Graph,
    Param,
    split_previous,
    split_reference,
)
from tactograph.graph.files.groups import (
    Use,
    flat_reference,
    in_scope,
    meant_nodes,
    uses_of,
    with_nodes,
)
from tactograph.graph.files.strict_yaml import Place

Change = Mapping[str, Any]
Places = Mapping[str, Place]

_ALLOWED: dict[str, tuple[set[str], set[str]]] = {
    # verb: (required keys, optional keys)
    "set": ({"settings"}, set()),
    "replace": (set(), {"op", "group", "inputs", "settings"}),
    "insert": (set(), {"op", "group", "inputs", "settings", "after"}),
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
    _check_keys(verb, change, place)
    target = str(change[verb])
    group, dot, inner = target.partition(".")
    if dot and group in graph.groups:
        return _change_group(graph, group, inner, change, places)
    if verb == "insert":
        _check_new(graph, target, place)
    elif target in graph.uses or target in graph.groups:
        return _change_uses(graph, target, change, places)
    elif target not in graph.nodes:
        known = [*graph.nodes, *graph.uses]
        known += [f"{g}.{node}" for g, its in graph.groups.items() for node in its.body.nodes]
        raise GraphError(
            f"{place}: {verb}: there is no node '{target}'{did_you_mean(target, known)}"
        )
    if "group" in change:
        return _put_use(graph, target, change, places)
    return _VERBS[verb](graph, target, _flat(graph, change, places, ""), places)


def _verb(change: Change) -> str:
    return next(verb for verb in _ALLOWED if verb in change)


def _check_keys(verb: str, change: Change, place: Place) -> None:
    given = set(change) - {verb}
    required, optional = _ALLOWED[verb]
    for key in sorted(required - given):
        raise GraphError(f"{place}: {verb} needs '{_IN_FILE.get(key, key)}'")
    for key in sorted(given - required - optional):
        raise GraphError(f"{place}: {verb} takes no '{_IN_FILE.get(key, key)}'")
    if "op" in optional and len(given & {"op", "group"}) != 1:
        raise GraphError(f"{place}: {verb} needs 'op' or 'group'")


def _check_new(graph: Graph, target: str, place: Place) -> None:
    if target in graph.nodes or target in graph.uses or target in graph.groups:
        kind = "group" if target in graph.groups else "node"
        raise GraphError(
            f"{place}: insert: there is a {kind} '{target}' already; give another name"
        )
    around = target.rpartition(".")[0]
    if around and around not in graph.uses:
        hint = did_you_mean(around, [*graph.uses, *graph.groups])
        raise GraphError(f"{place}: insert: there is no group, and no use of one, '{around}'{hint}")


def _flat(graph: Graph, change: Change, places: Places, scope: str) -> Change:
    """A change that stands in a scope, with references and values of the flat graph."""
    stated = Entry("", change.get("inputs", {}), change.get("settings", {}), places=places)
    stated = in_scope(graph, stated, scope)
    flat = {**change}
    for key in ("inputs", "settings"):
        if key in change:
            flat[key] = getattr(stated, key)
    if change.get("after") is not None:
        flat["after"] = flat_reference(graph, change["after"], scope, stated.where("after"))
    return flat


def _change_group(graph: Graph, name: str, node: str, change: Change, places: Places) -> Graph:
    """Change a node of a group: in the definition, and in every use."""
    place, verb = places[""], _verb(change)
    group = graph.groups[name]
    body = group.body
    if "group" in change:
        raise GraphError(f"{place}: {verb}: no group can be put into the group '{name}'")
    if node in body.uses:
        inside = body.uses[node].group
        raise GraphError(f"{place}: {verb}: '{node}' uses the group '{inside}'; change that one")
    known = [*body.nodes, *group.inputs]
    if verb == "insert" and node in known:
        raise GraphError(f"{place}: insert: the group '{name}' has '{node}' already")
    if verb != "insert" and node not in body.nodes:
        hint = did_you_mean(node, body.nodes)
        raise GraphError(f"{place}: {verb}: the group '{name}' has no node '{node}'{hint}")
    after = str(change.get("after") or "")
    if after.partition(".")[0] in group.inputs:
        raise GraphError(
            f"{place}: insert: after: '{after}' is an input of the group '{name}'; "
            "replace the nodes that read it"
        )
    body = _VERBS[verb](body, node, change, places)
    graph = replace(graph, groups={**graph.groups, name: replace(group, body=body)})
    for use in uses_of(graph, name):
        flat = f"{use}.{node}"
        if verb == "insert":
            _check_new(graph, flat, place)
        elif flat not in graph.nodes:
            continue
        here = {key: replace(at, use=graph.uses[use].place("")) for key, at in places.items()}
        graph = _VERBS[verb](graph, flat, _flat(graph, change, places, use), here)
    return graph


def _change_uses(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    """Change a use, or all uses of a group."""
    place, verb = places[""], _verb(change)
    if verb == "neutral":
        raise GraphError(
            f"{place}: neutral: '{target}' is no node, and has no neutral value; name its nodes"
        )
    if verb == "backend":
        for node in meant_nodes(graph, target):
            graph = _backend(graph, node, change, places)
        return graph
    if verb == "set" and target in graph.groups:
        body = graph.groups[target].body
        _check_params(target, body.params, change, places)
        given = {
            n: replace(body.params[n], required=False, default=v)
            for n, v in change["settings"].items()
        }
        body = replace(body, params={**body.params, **given})
        group = replace(graph.groups[target], body=body)
        graph = replace(graph, groups={**graph.groups, target: group})
        for use in uses_of(graph, target):
            graph = _set_use(graph, use, change["settings"], places)
        return graph
    if target in graph.groups:
        raise GraphError(f"{place}: {verb}: '{target}' is a group; name one of its nodes or uses")
    if verb == "set":
        _check_params(target, graph.groups[graph.uses[target].group].body.params, change, places)
        return _set_use(graph, target, change["settings"], places)
    if verb == "replace" and "group" in change:
        return _put_use(graph, target, change, places)
    inputs = graph.uses[target].inputs
    graph = _without_use(graph, target, keep_readers=verb == "replace")
    if verb == "remove":
        return graph
    flat = _flat(graph, {"inputs": inputs, **change}, places, "")
    return graph.with_entry(target, _entry(flat, places))


def _check_params(name: str, params: Mapping[str, Param], change: Change, places: Places) -> None:
    for param in change["settings"]:
        if param not in params:
            place = places.get(f"with.{param}", places[""])
            hint = did_you_mean(param, params) or f" (it takes: {', '.join(params) or 'none'})"
            raise GraphError(f"{place}: set: '{name}' has no param '{param}'{hint}")


def _set_use(graph: Graph, path: str, given: Mapping[str, Any], places: Places) -> Graph:
    """Give params to a use: to those of its nodes that take them."""
    use = graph.uses[path]
    body = graph.groups[use.group].body
    settings = {**use.settings, **given}
    graph = replace(graph, uses={**graph.uses, path: replace(use, settings=settings)})
    words = {f"${name}": value for name, value in given.items()}

    def taken(entry: Entry | Use) -> dict[str, Any]:
        settings = entry.settings.items()
        return {key: words[v] for key, v in settings if isinstance(v, str) and v in words}

    for name, entry in body.nodes.items():
        node = f"{path}.{name}"
        if taken(entry) and node in graph.nodes and graph.nodes[node].op == entry.op:
            graph = _set(graph, node, {"settings": taken(entry)}, places)
    for name, inside in body.uses.items():
        if taken(inside):
            graph = _set_use(graph, f"{path}.{name}", taken(inside), places)
    return graph


def _put_use(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    """Use a group, as a new node or in place of one."""
    inputs: Mapping[str, str] = {}
    if target in graph.uses:
        inputs = graph.uses[target].inputs
        graph = _without_use(graph, target, keep_readers=True)
    elif target in graph.nodes:
        inputs = graph.nodes[target].inputs
        graph = _remove(graph, target, change, places)
    elif change.get("after") is not None:
        after = str(flat_reference(graph, change["after"], "", str(places[""])))
        graph = _redirect(graph, after, target, places[""])
    use = Use(change["group"], change.get("inputs", inputs), change.get("settings", {}), places)
    graph = with_nodes(graph, {target: use})

    def flat(reference: str) -> str:
        return str(flat_reference(graph, reference, "", str(places[""])))

    return _with_references(graph, flat)


def _without_use(graph: Graph, path: str, *, keep_readers: bool) -> Graph:
    """The graph without the nodes of a use.

    With `keep_readers` those who read one of its outputs read ``path.output``, whatever makes
    it then.
    """
    outputs = graph.groups[graph.uses[path].group].body.outputs if keep_readers else {}
    swapped = {
        flat_reference(graph, f"{path}.{name}", "", path): f"{path}.{name}" for name in outputs
    }
    gone = f"{path}."
    graph = replace(
        graph,
        nodes={name: entry for name, entry in graph.nodes.items() if not name.startswith(gone)},
        uses={n: u for n, u in graph.uses.items() if n != path and not n.startswith(gone)},
    )
    return _with_references(graph, lambda reference: swapped.get(reference, reference))


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
    kept = {"inputs": graph.nodes[target].inputs, **change}
    return graph.with_entry(target, _entry(kept, places))


def _insert(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    if change.get("after") is not None:
        graph = _redirect(graph, change["after"], target, places[""])
    return graph.with_entry(target, _entry(change, places))


def _entry(change: Change, places: Places) -> Entry:
    inputs, settings = change.get("inputs", {}), change.get("settings", {})
    return Entry(op=change["op"], inputs=inputs, settings=settings, places=places)


def _redirect(graph: Graph, old: str, new: str, place: Place) -> Graph:
    # A node with one output is read by its name alone, or with the output's, which is the op.
    sole = f"{old}.{graph.nodes[old].op}" if old in graph.nodes else old
    changed = _with_references(graph, lambda r: new if r in (old, sole) else r)
    if (changed.nodes, changed.uses, changed.outputs) == (graph.nodes, graph.uses, graph.outputs):
        raise GraphError(f"{place}: insert: after: {_why_unread(graph, old)}")
    return changed


def _with_references(graph: Graph, changed: Callable[[str], str]) -> Graph:
    """The graph with every reference changed, whether it reads this item or the one before."""

    def swap(reference: str) -> str:
        bare, previous = split_previous(reference)
        return f"{PREVIOUS}.{changed(bare)}" if previous else changed(bare)

    def swapped(inputs: Mapping[str, str]) -> dict[str, str]:
        return {port: swap(reference) for port, reference in inputs.items()}

    return replace(
        graph,
        nodes={n: replace(entry, inputs=swapped(entry.inputs)) for n, entry in graph.nodes.items()},
        uses={n: replace(use, inputs=swapped(use.inputs)) for n, use in graph.uses.items()},
        outputs=swapped(graph.outputs),
    )


def _why_unread(graph: Graph, reference: str) -> str:
    """Why no input and no output of the graph reads a reference."""
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
