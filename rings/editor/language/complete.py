"""What may stand at the cursor."""

from collections.abc import Iterable
from pathlib import Path

from tactograph.rings.editor.language.cursor import Cursor, mapping
from tactograph.rings.editor.language.scope import PATCH_VERBS, Scope, scope_at, taken_by
from tactograph.sdk import Graph, GraphFile, nodes

CHANGE_VERBS = ("set", "replace", "remove", "backend", "neutral")
"""The verbs that speak of a node that is there."""
Offers = dict[str, str]
"""Words that may stand at the cursor, and what each is."""


def offers_at(cursor: Cursor, file: Path, graph: Graph | None) -> Offers:
    """The words that fit at the cursor; none where anything may stand."""
    if "extends" in cursor.path[-2:]:
        return _plain([*GraphFile.names(), *GraphFile.names("overlays")])
    scope = scope_at(cursor, file, graph)
    if not cursor.entry:
        return scope.ports if cursor.path[-2:-1] == ("outputs",) else {}
    match cursor.inside:
        case ("op",):
            return _plain(dir(nodes))
        case ("group",):
            names = (name.removesuffix(".group") for name in GraphFile.names("groups"))
            return _plain([*mapping(cursor.data.get("groups")), *names])
        case (verb,) if verb in CHANGE_VERBS and not cursor.is_key:
            return _changeable(scope)
        case ("after",):
            return scope.ports
        case ("in" | "carry" | "with" as kind, name):
            return _words_in(kind, str(name), cursor, scope, file)
    return _plain(PATCH_VERBS) if "patch" in cursor.path and len(cursor.inside) < 2 else {}


def _words_in(kind: str, name: str, cursor: Cursor, scope: Scope, file: Path) -> Offers:
    """Names of inputs or params, or what one may be given."""
    takes = taken_by(cursor.at(cursor.entry), scope, cursor, file)
    if cursor.is_key or cursor.path[-1] == kind:
        return {**(takes.params if kind == "with" else takes.inputs)}
    if kind != "with":
        return scope.ports
    params = {f"${each}": about for each, about in scope.params.items()}
    return _plain(map(str, takes.choices.get(name, ()))) | params


def _changeable(scope: Scope) -> Offers:
    """Nodes and uses, and nodes of groups, which a change means in every use."""
    groups = scope.graph.groups if scope.graph else {}
    inner = [f"{name}.{node}" for name, group in groups.items() for node in group.body.nodes]
    return _plain([*scope.names, *inner])


def _plain(words: Iterable[str]) -> Offers:
    return dict.fromkeys(words, "")
