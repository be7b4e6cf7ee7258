"""Lay a layer over a graph, or make a graph of one that stands alone."""

from collections.abc import Container, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace

from tactograph.graph.backends import PREFERRED_ORDER
from tactograph.graph.disk.strict_yaml import Document, Path_, Place, dotted, read_yaml
from tactograph.graph.errors import GraphError, InputError
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
    validate,
)
from tactograph.graph.files.graph_places import find_file, shipped_groups
from tactograph.graph.files.groups import flat_reference, refuse_idle, with_nodes
from tactograph.graph.files.layer import Layer
from tactograph.graph.files.patch_verbs import VERB_FUNCTIONS, Change, Places


@contextmanager
def blamed_on(place: Place) -> Iterator[None]:
    """Report a name that is missing or does not fit at the line that holds it."""
    try:
        yield
    except GraphError:
        raise
    except InputError as error:
        raise GraphError(f"{place}: {error}") from None


def alone(layer: Layer) -> Graph:
    """Make the graph of a file that extends no other.

    Raises GraphError if it is no graph, or a use of a group is wrong.
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
    return laid_over(Graph(layer.name, model.title, {}, tuple(PREFERRED_ORDER), {}, {}), layer)


def laid_over(graph: Graph, layer: Layer) -> Graph:
    """Apply the own content of a file or variant to a graph.

    Raises GraphError if a change does not fit the graph.
    """
    model, document = layer.model, layer.document
    nodes = model.nodes or {} if isinstance(model, GraphModel) else {}
    _refuse_taken(model.groups, {*graph.nodes, *graph.uses, *nodes}, graph.groups, document)
    changed = replace(
        graph,
        params={**graph.params, **_params(model.params, document, ("params",))},
        prefer=tuple(model.prefer) if model.prefer is not None else graph.prefer,
        outputs=_wanted({**graph.outputs, **model.outputs}),
        places={**graph.places, **_places(document, ())},
        inherited=frozenset(graph.params),
        groups={**graph.groups, **_groups(layer)},
    )
    changed = with_nodes(changed, _entries(nodes, document, ("nodes",)))
    changed = _flat_outputs(changed)
    for index, change in enumerate(model.patch or []):
        changed = apply_patch(changed, _stated(change), _places(document, ("patch", index)))
    return _flat_outputs(changed)


def _stated(change: PatchModel) -> Change:
    stated = {name: getattr(change, name) for name in change.model_fields_set}
    return {name: value for name, value in stated.items() if value is not None}


def _flat_outputs(graph: Graph) -> Graph:
    outputs = {
        name: flat_reference(graph, reference, "", graph.where(f"outputs.{name}"))
        for name, reference in graph.outputs.items()
    }
    return replace(graph, outputs=_wanted(outputs))


def _entries(
    nodes: Mapping[str, NodeModel | UseModel], document: Document, path: Path_
) -> dict[str, Entry | Use]:
    entries: dict[str, Entry | Use] = {}
    for node_id, node in nodes.items():
        places = _places(document, (*path, node_id))
        if isinstance(node, UseModel):
            entries[node_id] = Use(node.group, node.inputs, node.settings, places)
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
            file = find_file(stated.extends, layer.file.parent, shipped_groups())
            if file is None:
                raise InputError(f"'{stated.extends}' is not the file of a group (.group.yaml)")
        document = read_yaml(file)
        groups[name] = _group(name, validate(document, GroupFileModel), document, ())
        for index, change in enumerate(stated.patch):
            places = _places(layer.document, (*path, "patch", index))
            groups = _with_change(groups, name, _stated(change), places)
    return groups


def _with_change(
    groups: dict[str, Group], name: str, change: Change, places: Places
) -> dict[str, Group]:
    """Change a node of a group that no graph uses yet."""
    graph = Graph(name, "", {}, (), {}, {}, groups=groups)
    meant = {
        key: f"{name}.{said}" if key in VERB_FUNCTIONS else said for key, said in change.items()
    }
    return {**apply_patch(graph, meant, places).groups}


def _group(name: str, stated: GroupModel, document: Document, path: Path_) -> Group:
    entries = _entries(stated.nodes, document, (*path, "nodes"))
    body = Graph(
        name=name,
        title="",
        params=_params(stated.params, document, (*path, "params")),
        prefer=(),
        nodes={n: entry for n, entry in entries.items() if isinstance(entry, Entry)},
        outputs=stated.outputs,
        places=_places(document, path),
        uses={n: use for n, use in entries.items() if isinstance(use, Use)},
    )
    group = Group(_params(stated.inputs, document, (*path, "inputs")), body)
    refuse_idle(name, group)
    return group


def _refuse_taken(
    groups: Iterable[str], nodes: Iterable[str], earlier: Container[str], document: Document
) -> None:
    """Refuse a group that has the name of a node or of another group."""
    taken = {node.partition(".")[0] for node in nodes}
    for name in groups:
        place = document.place(("groups", name))
        if name in earlier:
            raise GraphError(f"{place}: there is a group '{name}' already; 'patch' changes it")
        if name in taken:
            raise GraphError(f"{place}: a node is called '{name}' too; give another name")


def _wanted(outputs: Mapping[str, str | None]) -> dict[str, str]:
    """Outputs without those that a variant sets to null."""
    return {name: reference for name, reference in outputs.items() if reference is not None}


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
            param.kind if isinstance(param, ParamModel) else "",
            param.help if param else "",
            (*path, name, "default") not in document.places,
            param.default if param else None,
        )
        for name, param in stated.items()
    }
