"""The names that a line may use: those of the graph before it, or of the group around it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tactograph.rings.editor.language.cursor import Cursor, mapping
from tactograph.rings.editor.language.declared import (
    NO_DECLARATION,
    Declared,
    of_data,
    of_group,
    of_node,
)
from tactograph.sdk import Document, Graph, GraphFile, InputError

PATCH_VERBS = ("set", "replace", "insert", "remove", "backend", "neutral")
BASE_OF_OVERLAYS = "reconstruct"
"""The graph by whose names an overlay is completed: it is written for several."""


@dataclass(frozen=True)
class Scope:
    """Nodes and uses by name, with what each makes, and params of the graph with their words."""

    names: Mapping[str, Declared] = field(default_factory=dict)
    params: Mapping[str, str] = field(default_factory=dict)
    graph: Graph | None = None

    @property
    def ports(self) -> dict[str, str]:
        """Everything that can be read, with its type: NODE of one output, else NODE.PORT."""
        ports: dict[str, str] = {}
        for name, declared in self.names.items():
            if len(declared.outputs) < 2 or self.graph is None:
                ports[name] = next(iter(declared.outputs.values()), "")
            if len(declared.outputs) > 1:
                ports |= {
                    f"{name}.{port}": port_name for port, port_name in declared.outputs.items()
                }
        return ports

    def declared(self, name: str) -> Declared:
        """What the node, use or group of a name takes."""
        graph = self.graph
        if graph is None:
            return self.names.get(name, NO_DECLARATION)
        full = graph.in_full(name)
        if full in graph.nodes:
            return of_node(graph.nodes[full].op)
        if graph.group_of(full) is not None:
            return of_group(graph, full)
        outer, _, inner = name.partition(".")
        entry = graph.groups[outer].body.nodes.get(inner) if outer in graph.groups else None
        return of_node(entry.op) if entry is not None else NO_DECLARATION


def scope_at(cursor: Cursor, file: Path, graph: Graph | None) -> Scope:
    """The names at the cursor: those of its group, else of the graph as it was last right.

    A file that never was right has the names of the graph that it extends.
    """
    body = _body_around(cursor)
    if body is not None:
        inputs = dict.fromkeys(mapping(body.get("inputs")), NO_DECLARATION)
        nodes = mapping(body.get("nodes")).items()
        uses = {name: taken_by(node, Scope(), cursor, file) for name, node in nodes}
        return Scope(inputs | uses, of_data(body).params)
    if graph is None:
        base = cursor.data.get("base") or cursor.data.get("extends") or BASE_OF_OVERLAYS
        try:
            graph = GraphFile(file).graphs_of(f"format: 1\nextends: '{base}'")[0]
        except InputError:  # there is no such graph
            return Scope()
    return of_graph(graph)


def of_graph(graph: Graph) -> Scope:
    """The names of a whole graph."""
    names = {graph.in_short(name): of_node(entry.op) for name, entry in graph.nodes.items()}
    names |= {graph.in_short(name): of_group(graph, name) for name in graph.uses}
    params = {
        name: f"{each.kind}, {each.state}; {each.help}" for name, each in graph.params.items()
    }
    return Scope(names, params, graph)


def taken_by(entry: Any, scope: Scope, cursor: Cursor, file: Path) -> Declared:
    """What the node or group takes that an entry of `nodes` or `patch` speaks of."""
    entry = mapping(entry)
    if "op" in entry:
        return of_node(str(entry["op"]))
    if "group" in entry:
        return _group(str(entry["group"]), cursor.data, file)
    verb = next((verb for verb in PATCH_VERBS if verb in entry), None)
    return scope.declared(str(entry[verb])) if verb else NO_DECLARATION


def _group(name: str, data: Mapping[str, Any], file: Path) -> Declared:
    """What a group of this file takes, or one of a file of its own."""
    stated = mapping(mapping(data.get("groups")).get(name)) or {"extends": f"{name}.group.yaml"}
    if "extends" not in stated:
        return of_data(stated)
    try:
        found = GraphFile.find(str(stated["extends"]), file.parent, "groups")
        return of_data(mapping(Document.read(found.place).data)) if found else NO_DECLARATION
    except InputError:
        return NO_DECLARATION


def _body_around(cursor: Cursor) -> dict[str, Any] | None:
    """The group whose node is at the cursor, if it is one that this file defines."""
    if "inputs" in cursor.data:
        return cursor.data
    if cursor.path[0] == "groups" and len(cursor.path) > 2 and cursor.path[2] != "patch":
        return mapping(cursor.at(cursor.path[:2]))
    return None
