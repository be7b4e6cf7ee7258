"""Apply a change of a variant, one patch verb, to a graph.

A change names a node of the flat graph (``save``, ``pass_2.label``), a use of a group (``pass_2``),
a group (``pass``), or a node of a group (``pass.label``), which it changes in every use.
"""

from tactograph.graph.errors import GraphError
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.files.patch_groups import (
    change_group,
    change_uses,
    check_new,
    flat_change,
    put_use,
)
from tactograph.graph.files.patch_verbs import VERB_FUNCTIONS, Change, Places

_NODE_KEYS = {"op", "group", "inputs", "settings", "repeat", "carry", "while_"}
KEYS_BY_VERB: dict[str, tuple[set[str], set[str]]] = {
    "set": (set(), {"inputs", "settings"}),
    "replace": (set(), _NODE_KEYS),
    "insert": (set(), {*_NODE_KEYS, "after"}),
    "remove": (set(), set()),
    "backend": ({"to"}, set()),
    "neutral": (set(), set()),
}
"""The keys that each verb needs, and its optional keys."""
IN_FILE = {"inputs": "in", "settings": "with", "while_": "while"}
"""Keys of a change that have another name in a file."""


def apply_patch(graph: Graph, change: Change, places: Places) -> Graph:
    """Return `graph` with one change made.

    Raises GraphError if the change does not have exactly one verb, if a key is missing or not
    allowed, or if the node does not exist.
    """
    place = places[""]
    verbs = [verb for verb in KEYS_BY_VERB if verb in change]
    if len(verbs) != 1:
        raise GraphError(
            f"{place}: a change has exactly one of {', '.join(KEYS_BY_VERB)}; "
            f"this one has {' and '.join(verbs) or 'none'}"
        )
    verb = verbs[0]
    _check_keys(verb, change, places)
    target = str(change[verb])
    if verb != "insert" or "." in target:
        target = graph.in_full(target)
    group, dot, inner = target.partition(".")
    if dot and group in graph.groups and group not in graph.uses:
        return change_group(graph, group, inner, change, places)
    if verb == "insert":
        check_new(graph, target, place)
    elif target in graph.uses or target in graph.groups:
        return change_uses(graph, target, change, places)
    elif target not in graph.nodes:
        names = [*graph.nodes, *graph.uses]
        names += [f"{g}.{node}" for g, its in graph.groups.items() for node in its.body.nodes]
        raise GraphError(f"{place}: {verb}: there is no node '{target}'{graph.hint(target, names)}")
    if "group" in change:
        return put_use(graph, target, change, places)
    return VERB_FUNCTIONS[verb](graph, target, flat_change(graph, change, places, ""), places)


def _check_keys(verb: str, change: Change, places: Places) -> None:
    place = places[""]
    keys = set(change) - {verb}
    required, optional = KEYS_BY_VERB[verb]
    for key in sorted(required - keys):
        raise GraphError(f"{place}: {verb} needs '{IN_FILE.get(key, key)}'")
    for key in sorted(keys - required - optional):
        raise GraphError(f"{place}: {verb} takes no '{IN_FILE.get(key, key)}'")
    if verb == "set" and not keys:
        raise GraphError(f"{place}: set needs 'with' or 'in'")
    for port, reference in change.get("inputs", {}).items():
        if reference is None and verb != "set":
            raise GraphError(f"{places.get(f'in.{port}', place)}: only 'set' takes an input away")
    if "op" in optional and len(keys & {"op", "group"}) != 1:
        raise GraphError(f"{place}: {verb} needs 'op' or 'group'")
    for key in sorted(keys & {"repeat", "carry", "while_"} if "op" in keys else ()):
        word = IN_FILE.get(key, key)
        raise GraphError(f"{places.get(word, place)}: only a group has '{word}'")
