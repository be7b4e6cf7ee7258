"""Groups: nodes that a graph defines once and uses several times, each time under new names.

The node ``label`` of a group becomes the node ``pass_2.label`` of its use ``pass_2``.  Inside the
group a reference names a node or an input of the group; outside it names a node, or an output of a
use.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from tactograph.graph.declare.ports import CONDITION_INPUT, ENGINE_INPUTS, RESTING_INPUT
from tactograph.graph.disk.strict_yaml import Place
from tactograph.graph.errors import GraphError, did_you_mean
from tactograph.graph.files.flat_graph import (
    PREVIOUS_ITEM,
    Entry,
    Graph,
    Group,
    Param,
    Use,
    params_in,
    split_previous,
)

MAX_NODES = 10_000
MAX_GROUP_DEPTH = 50
"""Limits on nodes and uses, and on nested groups, far above any real graph."""


def with_nodes(graph: Graph, nodes: Mapping[str, Entry | Use]) -> Graph:
    """Add nodes to a graph; each use of a group is replaced by the group's nodes.

    Raises GraphError if a use names no group, or lacks or adds an input or param; if a group uses
    itself, or refers to nothing; if there are too many nodes or nested groups.
    """
    added = _uses(graph, nodes, "", ())
    uses = {path: use for path, (use, _) in added.items()}
    stated = {name: entry for name, entry in nodes.items() if isinstance(entry, Entry)}
    wider = replace(
        graph,
        params=_with_group_params(graph, uses.values()),
        nodes={**graph.nodes, **stated},
        uses={**graph.uses, **uses},
    )
    for path, (use, around) in added.items():  # the use around another comes first
        bound = _bound(wider, use, around, path.rpartition(".")[2])
        wider = replace(wider, uses={**wider.uses, path: bound})
    return replace(wider, nodes={**graph.nodes, **_taken_apart(wider, nodes, "")})


def flat_reference(
    graph: Graph, reference: str, scope: str, where: str, *, whole: bool = False
) -> str | None:
    """Translate a reference in a scope to its name in the flat graph.

    Returns None for an input of the group that this use leaves out.  With `whole` the reference may
    name a use with several outputs, which are read through it.  Raises GraphError, with `where`, if
    it names nothing that can be read.
    """
    bare, previous = split_previous(reference)
    name, _, rest = bare.partition(".")
    if scope:
        use = graph.uses[scope]
        group = graph.definition(use)
        if name in group.inputs:
            if name not in use.inputs:
                return None
            name, already = split_previous(use.inputs[name])
            if previous and already:
                raise GraphError(f"{where}: only the item before is kept, not the one before that")
            previous = previous or already
        elif name in group.nodes:
            name = f"{scope}.{name}"
        else:
            hint = did_you_mean(name, [*group.nodes, *group.inputs])
            raise GraphError(
                f"{where}: the group '{use.group}' has no node or input '{name}'{hint}"
            )
    else:
        name = graph.in_full(name)
    flat = _port_of(graph, name, rest, where, whole=whole)
    return f"{PREVIOUS_ITEM}.{flat}" if previous else flat


def in_scope(
    graph: Graph, entry: Entry, scope: str, name: str = "", *, whole: bool = False
) -> Entry:
    """Translate an entry's references to the flat graph, and fill in the group's params.

    `name` is that of the entry in its scope.

    Raises GraphError if it refers to something that is not there.
    """
    if scope and not graph.uses[scope].turns:
        entry = replace(entry, places=_used_by(graph.uses[scope], entry))
    inputs = {
        port: _in_place(graph, reference, scope)
        if port == RESTING_INPUT
        else flat_reference(graph, reference, scope, entry.where(f"in.{port}"), whole=whole)
        for port, reference in entry.inputs.items()
    }
    around = graph.uses[scope].inputs.get(CONDITION_INPUT) if scope else None
    if around is not None and inputs.setdefault(CONDITION_INPUT, around) != around:
        raise GraphError(f"{entry.where('in.when')}: '{scope}', around it, has a condition already")
    resting = graph.uses[scope].inputs.get(RESTING_INPUT) if scope and name else None
    if resting is not None:
        inputs[RESTING_INPUT] = f"{resting}.{name}"
    return replace(
        entry,
        inputs={port: flat for port, flat in inputs.items() if flat is not None},
        settings=_settings(graph, entry, scope),
    )


def meant_nodes(graph: Graph, name: str) -> list[str]:
    """The nodes that a name means: those of a use, or for ``group.node`` that node in every use."""
    name = graph.in_full(name)
    if name in graph.nodes:
        return [name]
    first, _, inner = name.partition(".")
    uses = [] if first in graph.uses else graph.uses_of(first)
    paths = [_joined(use, inner) for use in uses] or [name]
    return [n for n in graph.nodes for path in paths if n == path or n.startswith(f"{path}.")]


def outputs_of(graph: Graph, path: str) -> Mapping[str, str]:
    """The outputs of a use; for a repeated use, those of its last turn."""
    return graph.definition(graph.uses[graph.last_turn(path)]).body.outputs


def refuse_idle(name: str, group: Group) -> None:
    """Refuse inputs and params of a group that no node reads, and outputs that no node has.

    Raises GraphError with the place of the first.
    """
    body, nodes = group.body, group.nodes
    references = [split_previous(r)[0] for e in nodes.values() for r in e.inputs.values()]
    read = {reference.partition(".")[0] for reference in references}
    params = {param for e in nodes.values() for param in params_in(e.settings).values()}
    for each in group.inputs:
        where = body.where(f"inputs.{each}")
        if each in nodes:
            raise GraphError(f"{where}: a node of the group '{name}' is called '{each}' too")
        if each not in read:
            raise GraphError(f"{where}: no node of the group '{name}' reads the input '{each}'")
    for each in body.params:
        if each not in params:
            where = body.where(f"params.{each}")
            raise GraphError(f"{where}: no node of the group '{name}' takes the param '${each}'")
    for output, reference in body.outputs.items():
        where, node = body.where(f"outputs.{output}"), reference.partition(".")[0]
        if node in group.inputs:
            raise GraphError(f"{where}: '{node}' is an input; read it where it comes from")
        if node not in nodes:
            hint = did_you_mean(node, nodes)
            raise GraphError(f"{where}: the group '{name}' has no node '{node}'{hint}")
        if output in nodes and node != output:
            raise GraphError(f"{where}: output '{output}' has the name of another node")


def _uses(
    graph: Graph, nodes: Mapping[str, Entry | Use], scope: str, chain: tuple[str, ...]
) -> dict[str, tuple[Use, str]]:
    """The uses among nodes, and nested in them, as written in their files, with their scopes."""
    uses: dict[str, tuple[Use, str]] = {}
    for name, use in nodes.items():
        if isinstance(use, Entry):
            continue
        path = _joined(scope, name) if scope else name
        if not use.turns and use.group not in graph.groups:
            hint = did_you_mean(use.group, graph.groups)
            there = f" (there are: {', '.join(graph.groups) or 'none'})"
            raise GraphError(
                f"{use.where('group')}: there is no group '{use.group}'{hint or there}"
            )
        if use.group in chain:
            loop = " -> ".join((*chain, use.group))
            raise GraphError(f"{use.where('group')}: a group cannot use itself: {loop}")
        if len(chain) >= MAX_GROUP_DEPTH:
            raise GraphError(
                f"{use.where('group')}: groups are nested more than {MAX_GROUP_DEPTH} deep"
            )
        group = graph.definition(use)
        _check_stated(use, "in", "input", use.inputs, group.inputs)
        _check_stated(use, "with", "param", use.settings, group.body.params)
        uses[path] = use, scope
        uses |= _uses(graph, group.body.uses, path, (*chain, use.group))
        if sum(1 + len(graph.definition(each).body.nodes) for each, _ in uses.values()) > MAX_NODES:
            # A few nested groups can multiply beyond any memory.
            raise GraphError(
                f"{use.where('group')}: with '{use.group}' there are more than {MAX_NODES} nodes "
                "and uses of groups; use them less often"
            )
    return uses


def _with_group_params(graph: Graph, uses: Iterable[Use]) -> dict[str, Param]:
    """The params of groups that state a kind, then those of the graph."""
    inherited: dict[str, Param] = {}
    for use in uses:
        body = graph.definition(use).body
        for name, param in body.params.items():
            if not param.kind or name in use.settings:
                continue
            first = graph.params.get(name) or inherited.setdefault(name, param)
            if first.kind != param.kind:
                raise GraphError(
                    f"{body.where(f'params.{name}.kind')}: the graph has a param '{name}' of kind "
                    f"'{first.kind}'; give another name, or a value where '{use.group}' is used"
                )
    return {**inherited, **graph.params}


def _check_stated(
    use: Use, key: str, word: str, stated: Mapping[str, Any], declared: Mapping[str, Param]
) -> None:
    for name in stated:
        if name not in declared and not (key == "in" and name in ENGINE_INPUTS):
            has = did_you_mean(name, declared) or f" (it takes: {', '.join(declared) or 'none'})"
            raise GraphError(
                f"{use.where(f'{key}.{name}')}: the group '{use.group}' has no {word} '{name}'{has}"
            )
    for name, param in declared.items():
        if param.required and not param.kind and name not in stated:
            raise GraphError(f"{use.where(key)}: the group '{use.group}' needs the {word} '{name}'")


def _bound(graph: Graph, use: Use, scope: str, name: str) -> Use:
    """A use with all its inputs and params, named as in the flat graph."""
    group = graph.definition(use)
    stated = Entry("", use.inputs, use.settings, places=use.places)
    own = in_scope(graph, stated, scope, name, whole=True)
    inputs: dict[str, str] = {}
    for name, param in group.inputs.items():
        if name in own.inputs:
            inputs[name] = own.inputs[name]
        elif name not in use.inputs and param.default:
            where = f"{group.body.where(f'inputs.{name}')} (used by {own.where()})"
            inputs[name] = str(flat_reference(graph, param.default, "", where, whole=True))
    inputs |= own.inputs  # `when` and `else`
    params = group.body.params.items()
    settings = {name: f"${name}" if p.kind else p.default for name, p in params} | {**own.settings}
    return replace(use, inputs=inputs, settings=settings, places=own.places)


def _taken_apart(graph: Graph, nodes: Mapping[str, Entry | Use], scope: str) -> dict[str, Entry]:
    flat: dict[str, Entry] = {}
    for name, entry in nodes.items():
        path = _joined(scope, name) if scope else name
        if isinstance(entry, Entry):
            flat[path] = in_scope(graph, entry, scope, name)
        else:
            flat |= _taken_apart(graph, graph.definition(entry).nodes, path)
    return flat


def _in_place(graph: Graph, reference: str, scope: str) -> str:
    """The name in the flat graph of a node, or use, of a scope."""
    return _joined(scope, reference) if scope else graph.in_full(reference)


def _port_of(graph: Graph, path: str, rest: str, where: str, *, whole: bool = False) -> str:
    """A port of a node; for a use, the port behind its output, or of a node in it."""
    if path not in graph.uses:
        return _joined(path, rest)
    use = graph.uses[path]
    name, nodes = use.group, graph.definition(use).nodes
    outputs = graph.definition(use).body.outputs
    first, _, port = rest.partition(".")
    if whole and not rest and len(outputs_of(graph, path)) != 1:
        return path
    if use.turns and first not in nodes:
        return _port_of(graph, graph.last_turn(path), rest, where)
    if not rest and len(outputs) == 1:
        (first,) = outputs
    if not first:
        choices = ", ".join(f"{path}.{o}" for o in outputs) or "none"
        raise GraphError(f"{where}: '{path}' uses the group '{name}'; say which output: {choices}")
    if first in outputs:
        inner = _joined(outputs[first], port)
    elif first in nodes or f"{path}.{first}" in {*graph.nodes, *graph.uses}:
        inner = rest
    else:
        hint = did_you_mean(first, [*outputs, *nodes])
        raise GraphError(f"{where}: the group '{name}' has no output or node '{first}'{hint}")
    head, _, port = inner.partition(".")
    return _port_of(graph, f"{path}.{head}", port, where)


def _settings(graph: Graph, entry: Entry, scope: str) -> dict[str, Any]:
    resolved = dict(entry.settings)
    for key, param in entry.params.items() if scope else ():
        use = graph.uses[scope]
        if param not in use.settings:
            where, hint = entry.where(f"with.{key}"), did_you_mean(param, use.settings)
            raise GraphError(f"{where}: the group '{use.group}' has no param '{param}'{hint}")
        resolved[key] = use.settings[param]
    return resolved


def _used_by(use: Use, entry: Entry) -> dict[str, Place]:
    """Places of a group's entry, each with the place of the use, which names the node."""
    stated = {f"in.{port}": f"in.{r.partition('.')[0]}" for port, r in entry.inputs.items()}
    stated |= {f"with.{key}": f"with.{str(v)[1:]}" for key, v in entry.settings.items()}
    places = entry.places.items()
    return {key: place._replace(use=use.place(stated.get(key, ""))) for key, place in places}


def _joined(name: str, rest: str) -> str:
    return f"{name}.{rest}" if rest else name
