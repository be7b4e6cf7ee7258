"""What the word at the cursor means, and where it is defined."""

import inspect
from pathlib import Path
from typing import NamedTuple

from tactograph.rings.editor.language.complete import CHANGE_VERBS
from tactograph.rings.editor.language.cursor import Cursor, mapping
from tactograph.rings.editor.language.declared import of_node
from tactograph.rings.editor.language.scope import Scope, scope_at, taken_by
from tactograph.sdk import Graph, GraphFile, InputError, nodes, read_graph


class Spot(NamedTuple):
    """A file and a line of it, from 0."""

    file: Path
    line: int = 0


def words_at(cursor: Cursor, file: Path, graph: Graph | None) -> str:
    """What the word at the cursor means, as Markdown; empty if that is not known."""
    scope, word = scope_at(cursor, file, graph), str(_value(cursor))
    if word.startswith("$"):
        return scope.params.get(word[1:], "")
    match cursor.inside:
        case ("op",):
            return of_node(word).summary
        case ("with" | "in" as kind, name) if cursor.is_key:
            takes = taken_by(cursor.at(cursor.entry), scope, cursor, file)
            return (takes.params if kind == "with" else takes.inputs).get(str(name), "")
        case (verb,) if verb in CHANGE_VERBS:
            return scope.declared(word).summary
    return scope.ports.get(word.removeprefix("previous."), "")


def definition_at(cursor: Cursor, file: Path, graph: Graph | None) -> Spot | None:
    """Where the word at the cursor is defined: a node, a group, a graph, or a node's code."""
    word = str(_value(cursor))
    try:
        if "extends" in cursor.path[-2:]:
            near = file.parent
            found = GraphFile.find(word, near, "overlays") or GraphFile.find(word, near, "graphs")
            return Spot(found.place if found else read_graph(word).file)
        if cursor.inside == ("op",):
            function = inspect.unwrap(getattr(nodes, word).function)
            return Spot(Path(inspect.getfile(function)), inspect.getsourcelines(function)[1] - 1)
        if cursor.inside == ("group",) and word not in mapping(cursor.data.get("groups")):
            group = GraphFile.find(f"{word}.group.yaml", file.parent, "groups")
            return Spot(group.place) if group else None
    except (InputError, AttributeError):  # there is no such file, or node
        return None
    return _of_name(word.removeprefix("previous."), scope_at(cursor, file, graph))


def _of_name(name: str, scope: Scope) -> Spot | None:
    """The line of a node, a use, a group or a param in the file that holds it."""
    graph = scope.graph
    if graph is None:
        return None
    while name:
        full = graph.in_full(name)
        entry = graph.nodes.get(full) or graph.uses.get(full)
        place = entry.places.get("") if entry is not None else None
        place = place or graph.places.get(f"groups.{name}")
        place = place or graph.places.get(f"params.{name.removeprefix('$')}")
        if place is not None and place.line:
            return Spot(Path(place.file), place.line - 1)
        name = name.rpartition(".")[0]
    return None


def _value(cursor: Cursor) -> object:
    return cursor.path[-1] if cursor.is_key else cursor.at(cursor.path)
