"""Read a graph file: strict YAML, `extends` followed, patches applied, all errors placed."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Container, Iterable, Mapping
from dataclasses import replace
from importlib import resources
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from tactograph.graph.backends import PREFERRED
from tactograph.graph.errors import GraphError, InputError, did_you_mean
from tactograph.graph.files.apply_patch import apply_patch
from tactograph.graph.files.flat_graph import Entry, Graph, Group, Param, Use
from tactograph.graph.files.graph_model import (
    GraphModel,
    GroupInputModel,
    GroupParamModel,
    NodeModel,
    ParamModel,
    UseModel,
    validate,
)
from tactograph.graph.files.groups import flat_reference, refuse_idle, with_nodes
from tactograph.graph.files.plain_data import as_document
from tactograph.graph.files.strict_yaml import Document, Path_, Place, dotted, read_yaml

GROUP = "tactograph.pipelines"


def shipped_names() -> list[str]:
    """The bare names of the pipelines that ship."""
    folder = resources.files("tactograph.pipelines")
    return sorted(f.name[:-5] for f in folder.iterdir() if f.name.endswith(".yaml"))


def graph_file(name: str, beside: Path | None = None) -> Path:
    """Resolve a path, a bare name or ``package/name`` to a graph file.

    A package brings pipelines through the entry-point group ``tactograph.pipelines``: the
    point's name is what is said before the slash, its value the package with the files.

    Raises
    ------
    InputError
        If there is neither such a file nor a shipped pipeline of that name.
    """
    package, slash, graph = name.partition("/")
    if slash and "/" not in graph and (folder := _plugin_folder(package)) is not None:
        if (folder / f"{graph}.yaml").is_file():
            return folder / f"{graph}.yaml"
        known = sorted(file.stem for file in folder.glob("*.yaml"))
        raise InputError(
            f"the package {package} brings no pipeline '{graph}'{did_you_mean(graph, known)}"
            f" (it brings: {', '.join(known) or 'none'})"
        )
    if name.endswith((".yaml", ".yml")) or "/" in name:
        path = Path(name)
        if beside is not None and not path.is_absolute():
            path = beside / path
        if _is_file(path):
            return path
        if path.name == name and name.removesuffix(".yaml") in shipped_names():
            return Path(str(resources.files("tactograph.pipelines") / name))
        raise InputError(f"{path}: there is no such graph file")
    if name not in shipped_names():
        hint = did_you_mean(name, shipped_names())
        there = f" (the shipped ones are: {', '.join(shipped_names())})"
        raise InputError(
            f"'{name}' is neither a graph file (.yaml) nor a pipeline that ships{hint or there}"
        )
    return Path(str(resources.files("tactograph.pipelines") / f"{name}.yaml"))


def _plugin_folder(package: str) -> Path | None:
    """The folder of pipelines that an installed package brings under a name."""
    for point in entry_points(group=GROUP, name=package):
        spec = importlib.util.find_spec(point.value)
        for place in (spec and spec.submodule_search_locations) or ():
            return Path(place)
        raise InputError(
            f"the pipelines of {package} should lie in {point.value}; it is no package"
        )
    return None


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that no file can have
        return False


Source = str | os.PathLike[str] | Mapping[str, Any] | Graph
"""A graph by name, by path, as plain data, or as it is."""


def read_graph(source: Source) -> Graph:
    """Read a graph: a path, the bare name of a shipped pipeline, or plain data like a file's.

    Raises
    ------
    InputError
        If the file is not there.
    GraphError
        With file, line, column, path and reason, if it is not a graph file.
    """
    if isinstance(source, Graph):
        return source
    if isinstance(source, Mapping):
        return _resolved(as_document(source), "graph", Path(), ())
    return _read(graph_file(os.fspath(source)), ())


def _read(file: Path, chain: tuple[Path, ...]) -> Graph:
    if file.resolve() in chain:
        loop = " -> ".join(p.name for p in (*chain, file))
        raise GraphError(f"{file}: 'extends' runs in a loop: {loop}")
    return _resolved(read_yaml(file), file.stem, file.parent, (*chain, file.resolve()))


def _resolved(document: Document, name: str, folder: Path, chain: tuple[Path, ...]) -> Graph:
    """The graph of a document that lies in `folder`, with `extends` followed."""
    model = validate(document)
    if model.extends is None:
        return _flat(model, document, name)
    if model.nodes is not None:
        raise GraphError(
            f"{document.place(('nodes',))}: a file that extends another has no 'nodes'; "
            "add one with '- insert: ID' under 'patch'"
        )
    try:
        parent_file = graph_file(model.extends, beside=folder)
    except InputError as error:
        raise GraphError(f"{document.place(('extends',))}: {error}") from None
    parent = _read(parent_file, chain)
    _refuse_taken(model.groups, {*parent.nodes, *parent.uses}, parent.groups, document)
    merged = Graph(
        name=name,
        title=model.title or parent.title,
        params={**parent.params, **_params(model.params, document, ("params",))},
        prefer=tuple(model.prefer) if model.prefer is not None else parent.prefer,
        nodes=parent.nodes,
        outputs=_wanted({**parent.outputs, **model.outputs}),
        places={**parent.places, **_places(document, ())},
        groups={**parent.groups, **_groups(model, document)},
        uses=parent.uses,
    )
    merged = _flat_outputs(merged)
    for index, change in enumerate(model.patch or []):
        places = _places(document, ("patch", index))
        stated = {name: getattr(change, name) for name in change.model_fields_set}
        merged = apply_patch(merged, stated, places)
    return _flat_outputs(merged)


def _flat(model: GraphModel, document: Document, name: str) -> Graph:
    if model.patch is not None:
        raise GraphError(f"{document.place(('patch',))}: 'patch' needs 'extends'")
    if not model.nodes:
        raise GraphError(f"{document.place(())}: nodes: a graph needs at least one node")
    _refuse_taken(model.groups, model.nodes, (), document)
    for node_id in model.nodes:
        inside = {node_id[:at] for at, letter in enumerate(node_id) if letter == "."}
        for outer in sorted(inside & model.nodes.keys()):
            raise GraphError(
                f"{document.place(('nodes', node_id))}: '{outer}' is a node; none can be in it"
            )
    graph = Graph(
        name=name,
        title=model.title,
        params=_params(model.params, document, ("params",)),
        prefer=tuple(model.prefer if model.prefer is not None else PREFERRED),
        nodes={},
        outputs=_wanted(model.outputs),
        places=_places(document, ()),
        groups=_groups(model, document),
    )
    return _flat_outputs(with_nodes(graph, _entries(model.nodes, document, ("nodes",))))


def _flat_outputs(graph: Graph) -> Graph:
    outputs = {
        name: flat_reference(graph, reference, "", graph.where(f"outputs.{name}"))
        for name, reference in graph.outputs.items()
    }
    return replace(graph, outputs=_wanted(outputs))


def _entries(
    nodes: Mapping[str, NodeModel | UseModel], document: Document, path: Path_
) -> dict[str, Entry | Use]:
    found: dict[str, Entry | Use] = {}
    for node_id, node in nodes.items():
        places = _places(document, (*path, node_id))
        if isinstance(node, UseModel):
            found[node_id] = Use(node.group, node.inputs, node.settings, places)
        else:
            found[node_id] = Entry(
                node.op, node.inputs, node.settings, node.backend, node.neutral, places
            )
    return found


def _groups(model: GraphModel, document: Document) -> dict[str, Group]:
    found: dict[str, Group] = {}
    for name, stated in model.groups.items():
        path: Path_ = ("groups", name)
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
        found[name] = Group(_params(stated.inputs, document, (*path, "inputs")), body)
        refuse_idle(name, found[name])
    return found


def _refuse_taken(
    groups: Iterable[str], nodes: Iterable[str], earlier: Container[str], document: Document
) -> None:
    """Refuse a group whose name would not tell it from a node, or from another group."""
    taken = {node.partition(".")[0] for node in nodes}
    for name in groups:
        place = document.place(("groups", name))
        if name in earlier:
            raise GraphError(f"{place}: there is a group '{name}' already; 'patch' changes it")
        if name in taken:
            raise GraphError(f"{place}: a node is called '{name}' too; give another name")


def _wanted(outputs: Mapping[str, str | None]) -> dict[str, str]:
    """The outputs without those that a variant gives as null."""
    return {name: reference for name, reference in outputs.items() if reference is not None}


def _places(document: Document, path: Path_) -> dict[str, Place]:
    """The places of everything below `path`, by dotted path relative to it."""
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
