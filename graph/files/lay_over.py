"""Lay a layer over a graph, or make a graph from a layer that extends none."""

from collections.abc import Container, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from tactograph.graph.backends import PREFERRED_ORDER
from tactograph.graph.disk.strict_yaml import Document, Path_, Place, dotted
from tactograph.graph.errors import ErrorsTogether, GraphError, InputError
from tactograph.graph.files.apply_patch import apply_patch
from tactograph.graph.files.flat_graph import Entry, Graph, Group, Param, Use
from tactograph.graph.files.graph_model import (
    GraphModel,
    GroupFileModel,
    GroupInputModel,
    GroupModel,
    GroupParamModel,
    NodeModel,
    ParamModel,
    PatchModel,
    SharedGroupModel,
    UseModel,
    VariantModel,
    validate,
)
from tactograph.graph.files.graph_places import find_file
from tactograph.graph.files.groups import flat_reference, refuse_idle, with_nodes
from tactograph.graph.files.implied_params import with_implied_params
from tactograph.graph.files.iterate import in_turns
from tactograph.graph.files.layer import Layer
from tactograph.graph.files.patch_verbs import VERB_FUNCTIONS, Change


@contextmanager
def blamed_on(place: Place) -> Iterator[None]:
    """Report an InputError of the block at this place."""
    try:
        yield
    except GraphError:
        raise
    except InputError as error:
        raise GraphError(f"{place}: {error}") from None


def alone(layer: Layer) -> Graph:
    """Make the graph of a file that extends no other.

    Raises GraphError if the file is not a graph, or if a use of a group is wrong.
    """
    model, document = layer.model, layer.document
    assert isinstance(model, GraphModel)
    if model.patch is not None:
        raise GraphError(
            f"{document.place(('patch',))}: 'patch' needs 'extends'; this is an overlay, which "
            f"'--with {layer.file}' lays over a graph"
        )
    if not model.nodes:
        raise GraphError(f"{document.place(())}: nodes: a graph needs at least one node")
    for node_id in model.nodes:
        inside = {node_id[:at] for at, letter in enumerate(node_id) if letter == "."}
        for outer in sorted(inside & model.nodes.keys()):
            raise GraphError(
                f"{document.place(('nodes', node_id))}: '{outer}' is a node; none can be in it"
            )
    return laid_over(Graph(layer.name, model.title, prefer=tuple(PREFERRED_ORDER)), layer)


def laid_over(graph: Graph, layer: Layer) -> Graph:
    """Apply the changes of a file or variant to a graph.

    Raises GraphError if a change does not fit the graph.
    """
    model, document = layer.model, layer.document
    nodes = model.nodes or {} if isinstance(model, GraphModel) else {}
    names = {name: use.group for name, use in graph.uses.items()} | {
        name: node.group if isinstance(node, UseModel) else "" for name, node in nodes.items()
    }
    _refuse_used_names(model.groups, dict.fromkeys(graph.nodes, "") | names, graph.groups, document)
    changed = replace(
        graph,
        params={**graph.params, **_params(model.params, document, ("params",))},
        prefer=tuple(model.prefer) if model.prefer is not None else graph.prefer,
        outputs={n: r for n, r in {**graph.outputs, **model.outputs}.items() if r is not None},
        places={**graph.places, **_places(document, ())},
        inherited=frozenset(graph.params),
        groups=_with_shared({**graph.groups, **_groups(layer)}, _used(model), layer.file.parent),
    )
    changed = with_nodes(changed, _entries(nodes, document, ("nodes",)))
    changed = _flat_outputs(changed)
    changed = _patched(changed, model.patch or [], document)
    return _without_unread(with_implied_params(_flat_outputs(changed)), model.params)


def _patched(graph: Graph, changes: list[PatchModel], document: Document) -> Graph:
    """Make all changes.  Raises GraphError with the errors of all independent changes."""
    errors, missing = ErrorsTogether(), set[str]()
    for index, change in enumerate(changes):
        for each in _stated(change):
            named = {str(each[key]) for key in (*VERB_FUNCTIONS, "after") if each.get(key)}
            if not named.isdisjoint(missing):
                continue
            new = {str(each["insert"])} if "insert" in each else set()
            missing |= new
            with errors.gathered():
                graph = apply_patch(graph, each, _places(document, ("patch", index)))
                missing -= new
    errors.raise_any()
    return graph


def _without_unread(graph: Graph, stated: Container[str]) -> Graph:
    """The graph without params that no node takes, except those `stated` here."""
    read = {param for entry in graph.nodes.values() for param in entry.params.values()}
    params = graph.params.items()
    return replace(graph, params={n: p for n, p in params if n in stated or n in read})


def _stated(change: PatchModel) -> list[Change]:
    """Split a change into one for each node that it names."""
    stated = {name: getattr(change, name) for name in change.model_fields_set}
    listed = [verb for verb in VERB_FUNCTIONS if isinstance(stated.get(verb), list)]
    if not listed:
        return [stated]
    return [{**stated, listed[0]: target} for target in stated[listed[0]]]


def _flat_outputs(graph: Graph) -> Graph:
    """The graph whose outputs name nodes, none of which a group may leave out."""
    outputs = {
        name: str(flat_reference(graph, reference, "", graph.where(f"outputs.{name}")))
        for name, reference in graph.outputs.items()
    }
    return replace(graph, outputs=outputs)


def _entries(
    nodes: Mapping[str, NodeModel | UseModel], document: Document, path: Path_
) -> dict[str, Entry | Use]:
    entries: dict[str, Entry | Use] = {}
    for node_id, node in nodes.items():
        places = _places(document, (*path, node_id))
        if isinstance(node, UseModel):
            use = Use(node.group, node.inputs, node.settings, places)
            entries[node_id] = in_turns(use, node.repeat, node.carry, node.while_)
        else:
            entries[node_id] = Entry(
                node.op, node.inputs, node.settings, node.backend, node.neutral, places
            )
    return entries


def _groups(layer: Layer) -> dict[str, Group]:
    groups: dict[str, Group] = {}
    for name, stated in layer.model.groups.items():
        path = ("groups", name)
        if not isinstance(stated, SharedGroupModel):
            groups[name] = _group(name, stated, layer.document, path)
            continue
        with blamed_on(layer.document.place((*path, "extends"))):
            file = find_file(stated.extends, layer.file.parent, "groups")
            if file is None:
                raise InputError(f"'{stated.extends}' is not the file of a group (.group.yaml)")
        group = group_in(name, Document.read(file))
        params = _params(stated.params, layer.document, (*path, "params"))
        body = replace(group.body, params={**group.body.params, **params})
        groups[name] = replace(group, body=body)
        for index, change in enumerate(stated.patch):
            places = _places(layer.document, (*path, "patch", index))
            for each in _stated(change):
                graph = Graph(name, groups=groups)
                named = {key: f"{name}.{each[key]}" for key in VERB_FUNCTIONS if key in each}
                groups = {**apply_patch(graph, {**each, **named}, places).groups}
    return groups


def _used(model: GraphModel | VariantModel) -> list[str]:
    """The groups that a graph file names in its nodes, its patch and its own groups."""
    nodes: list[Any] = [*((model.nodes or {}) if isinstance(model, GraphModel) else {}).values()]
    nodes += model.patch or []
    for group in model.groups.values():
        nodes += group.patch if isinstance(group, SharedGroupModel) else group.nodes.values()
    return [node.group for node in nodes if getattr(node, "group", None) is not None]


def _with_shared(groups: dict[str, Group], used: Iterable[str], folder: Path) -> dict[str, Group]:
    """Groups, and those that are used but not among them, from files NAME.group.yaml.

    A name without a file is refused where it is used.
    """
    for name in used:
        file = None
        with suppress(InputError):
            file = None if name in groups else find_file(f"{name}.group.yaml", folder, "groups")
        if file is not None:
            groups = {**groups, name: group_in(name, Document.read(file))}
            groups = _with_shared(groups, _used_in(groups[name]), file.parent)
    return groups


def _used_in(group: Group) -> Iterator[str]:
    """The groups that a group uses, repeated or not."""
    for use in group.body.uses.values():
        yield from (use.group, *_used_in(use.turns)) if use.turns else [use.group]


def group_in(name: str, document: Document) -> Group:
    """The group of a document that is, or is to be, the content of its file."""
    return _group(name, validate(document, GroupFileModel), document, ())


def _group(name: str, stated: GroupModel, document: Document, path: Path_) -> Group:
    entries = _entries(stated.nodes, document, (*path, "nodes"))
    body = Graph(
        name,
        params=_params(stated.params, document, (*path, "params")),
        nodes={n: entry for n, entry in entries.items() if isinstance(entry, Entry)},
        outputs=stated.outputs,
        places=_places(document, path),
        uses={n: use for n, use in entries.items() if isinstance(use, Use)},
    )
    group = Group(_params(stated.inputs, document, (*path, "inputs")), body)
    refuse_idle(name, group)
    return group


def _refuse_used_names(
    groups: Iterable[str], nodes: Mapping[str, str], earlier: Container[str], document: Document
) -> None:
    """Refuse a group with the name of another group, or of a node that is no use of it."""
    group_by_node = {node.partition(".")[0]: group for node, group in nodes.items()}
    for name in groups:
        place = document.place(("groups", name))
        if name in earlier:
            raise GraphError(f"{place}: there is a group '{name}' already; 'patch' changes it")
        if group_by_node.get(name, name) != name:
            raise GraphError(f"{place}: a node is called '{name}' too; give another name")


def _places(document: Document, path: Path_) -> dict[str, Place]:
    """Places of all keys below `path`, by dotted path relative to it."""
    size = len(path)
    return {dotted(p[size:]): place for p, place in document.places.items() if p[:size] == path}


def _params(
    stated: Mapping[str, ParamModel | GroupParamModel | GroupInputModel | None],
    document: Document,
    path: Path_,
) -> dict[str, Param]:
    return {
        name: Param(
            (not isinstance(param, GroupInputModel) and param and param.kind) or "",
            param.help if param else "",
            (*path, name, "default") not in document.places,
            param.default if param else None,
        )
        for name, param in stated.items()
    }
