"""Changes to groups and to their uses, by the patch verbs."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from tactograph.graph.disk.strict_yaml import Place
from tactograph.graph.errors import GraphError, did_you_mean
from tactograph.graph.files.flat_graph import Entry, Graph, Use, params_in
from tactograph.graph.files.groups import (
    flat_reference,
    in_scope,
    meant_nodes,
    outputs_of,
    with_nodes,
)
from tactograph.graph.files.iterate import in_turns
from tactograph.graph.files.patch_verbs import (
    VERB_FUNCTIONS,
    Change,
    Places,
    entry_of,
    redirect,
    verb_of,
    with_references,
)


def check_new(graph: Graph, target: str, place: Place) -> None:
    """Refuse a node's name that is already taken."""
    if target in graph.nodes or target in graph.uses or target in graph.groups:
        kind = "group" if target in graph.groups else "node"
        raise GraphError(
            f"{place}: insert: there is a {kind} '{target}' already; give another name"
        )
    around = target.rpartition(".")[0]
    if around and around not in graph.uses:
        hint = did_you_mean(around, [*graph.uses, *graph.groups])
        raise GraphError(f"{place}: insert: there is no group, and no use of one, '{around}'{hint}")


def flat_change(graph: Graph, change: Change, places: Places, scope: str, node: str = "") -> Change:
    """Translate a change in a scope to references and values of the flat graph.

    `node` is the name, in that scope, of the node that it changes.
    """
    reads = change.get("inputs", {})
    reads_set = {port: reference for port, reference in reads.items() if reference is not None}
    stated = Entry("", reads_set, change.get("settings", {}), places=places)
    stated = in_scope(graph, stated, scope, node)
    unset = dict.fromkeys(reads.keys() - reads_set.keys())
    translated = {"inputs": {**stated.inputs, **unset}, "settings": stated.settings}
    flat = {**change, **{key: translated[key] for key in translated.keys() & change.keys()}}
    if change.get("after") is not None:
        flat["after"] = flat_reference(graph, change["after"], scope, stated.where("after"))
    return flat


def change_group(graph: Graph, name: str, node: str, change: Change, places: Places) -> Graph:
    """Change a node of a group: in the definition, and in every use."""
    place, verb = places[""], verb_of(change)
    group = graph.groups[name]
    body = group.body
    if node in body.uses:
        inside = body.uses[node].group
        raise GraphError(f"{place}: {verb}: '{node}' uses the group '{inside}'; change that one")
    names = [*body.nodes, *group.inputs]
    if verb == "insert" and node in names:
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
    change_body = _put_into_body if "group" in change else VERB_FUNCTIONS[verb]
    body = change_body(body, node, change, places)
    graph = replace(graph, groups={**graph.groups, name: replace(group, body=body)})
    for use in graph.uses_of(name):
        flat = f"{use}.{node}"
        if verb == "insert":
            check_new(graph, flat, place)
        elif flat not in graph.nodes:
            continue
        here = {key: at._replace(use=graph.uses[use].place("")) for key, at in places.items()}
        change_flat = put_use if "group" in change else VERB_FUNCTIONS[verb]
        graph = change_flat(graph, flat, flat_change(graph, change, places, use, node), here)
    return graph


def _put_into_body(body: Graph, node: str, change: Change, places: Places) -> Graph:
    """Use a group in another group, as a new node of its definition or replacing one."""
    inputs: Mapping[str, str] = {}
    if node in body.nodes:
        inputs = body.nodes[node].inputs
        body = VERB_FUNCTIONS["remove"](body, node, change, places)
    elif change.get("after") is not None:
        body = redirect(body, change["after"], node, places[""])
    return replace(body, uses={**body.uses, node: _use(change, inputs, places)})


def _use(change: Change, inputs: Mapping[str, str], places: Places) -> Use:
    """The use that a change makes; `inputs` are its defaults."""
    use = Use(change["group"], change.get("inputs", inputs), change.get("settings", {}), places)
    return in_turns(use, change.get("repeat"), change.get("carry"), change.get("while_"))


def change_uses(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    """Change a use, or all uses of a group."""
    place, verb = places[""], verb_of(change)
    if verb == "set":
        return _set_params(graph, target, change, places)
    if verb == "backend":
        for node in meant_nodes(graph, target):
            graph = VERB_FUNCTIONS[verb](graph, node, change, places)
        return graph
    if verb == "neutral" or target not in graph.uses:
        kind = "a use of a group" if target in graph.uses else "a group"
        raise GraphError(f"{place}: {verb}: '{target}' is {kind}; name one of its nodes")
    if "group" in change:
        return put_use(graph, target, change, places)
    inputs = graph.uses[target].inputs
    graph = _without_use(graph, target, place, keep_readers=verb == "replace")
    if verb == "remove":
        return graph
    flat = flat_change(graph, {"inputs": inputs, **change}, places, "")
    return graph.with_entry(target, entry_of(flat, places))


def _set_params(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    """Set params of a use, or of all present and later uses of a group."""
    if "inputs" in change:
        place = places.get("in", places[""])
        raise GraphError(f"{place}: set: '{target}' is a group or a use of one; 'replace' it")
    if target in graph.uses and (turns := graph.uses[target].turns):
        for turn in turns.body.uses:
            graph = _set_params(graph, f"{target}.{turn}", change, places)
        return graph
    values: Mapping[str, Any] = change["settings"]
    name = graph.uses[target].group if target in graph.uses else target
    group = graph.groups[name]
    params = group.body.params
    for param in values:
        if param not in params:
            place = places.get(f"with.{param}", places[""])
            hint = did_you_mean(param, params) or f" (it takes: {', '.join(params) or 'none'})"
            raise GraphError(f"{place}: set: the group '{name}' has no param '{param}'{hint}")
    if target in graph.uses:
        return _set_use(graph, target, values, places)
    stated = {n: replace(params[n], kind="", required=False, default=v) for n, v in values.items()}
    body = replace(group.body, params={**params, **stated})
    graph = replace(graph, groups={**graph.groups, name: replace(group, body=body)})
    for use in graph.uses_of(name):
        graph = _set_use(graph, use, values, places)
    return graph


def _set_use(graph: Graph, path: str, values: Mapping[str, Any], places: Places) -> Graph:
    """Set params of a use, in those of its nodes that take them."""
    use = graph.uses[path]
    body = graph.definition(use).body
    settings = {**use.settings, **values}
    graph = replace(graph, uses={**graph.uses, path: replace(use, settings=settings)})
    nodes = graph.definition(use).nodes.values()
    read = {param for each in nodes for param in params_in(each.settings).values()}
    if unread := [name for name in values if name not in read]:
        raise GraphError(
            f"{places['']}: set: no node of the group '{use.group}' takes the param '{unread[0]}' "
            "any more, since an earlier change gave its reader a value"
        )

    def changed(entry: Entry | Use) -> dict[str, Any]:
        params = params_in(entry.settings).items()
        return {key: values[param] for key, param in params if param in values}

    for name, entry in body.nodes.items():
        node = f"{path}.{name}"
        if changed(entry) and node in graph.nodes and graph.nodes[node].op == entry.op:
            graph = VERB_FUNCTIONS["set"](graph, node, {"settings": changed(entry)}, places)
    for name, inside in body.uses.items():
        if changed(inside):
            graph = _set_use(graph, f"{path}.{name}", changed(inside), places)
    return graph


def put_use(graph: Graph, target: str, change: Change, places: Places) -> Graph:
    """Use a group, as a new node or in place of one."""
    inputs: Mapping[str, str] = {}
    if target in graph.uses:
        ports = graph.groups[change["group"]].inputs if change["group"] in graph.groups else {}
        inputs = {n: reads for n, reads in graph.uses[target].inputs.items() if n in ports}
        graph = _without_use(graph, target, places[""], keep_readers=True)
    elif target in graph.nodes:
        inputs = graph.nodes[target].inputs
        graph = VERB_FUNCTIONS["remove"](graph, target, change, places)
    elif change.get("after") is not None:
        after = str(flat_reference(graph, change["after"], "", str(places[""])))
        graph = redirect(graph, after, target, places[""])
    graph = with_nodes(graph, {target: _use(change, inputs, places)})

    def flat(reference: str) -> str:
        return str(flat_reference(graph, reference, "", str(places[""]), whole=True))

    return with_references(graph, flat)


def _without_use(graph: Graph, path: str, place: Place, *, keep_readers: bool) -> Graph:
    """Return the graph without the nodes of a use.

    With `keep_readers`, readers of its outputs read ``path.output`` of whatever replaces it.
    """
    outputs = outputs_of(graph, path) if keep_readers else {}
    swapped = {
        flat_reference(graph, f"{path}.{name}", "", path): f"{path}.{name}" for name in outputs
    }
    prefix = f"{path}."
    graph = replace(
        graph.without([name for name in graph.nodes if name.startswith(prefix)], place),
        uses={n: u for n, u in graph.uses.items() if n != path and not n.startswith(prefix)},
    )
    return with_references(graph, lambda reference: swapped.get(reference, reference))
