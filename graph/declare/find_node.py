"""Find a node by its name in a graph.

``op: x`` is function ``x`` of a file ``x.py`` in the folder ``nodes`` of the core or of a ring
(`rings`), in any room.  Only the nodes that a graph names are imported.
"""

import importlib
import re
import sys
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache

from tactograph.graph.declare.node import Node
from tactograph.graph.errors import GraphError, InputError, NodeError, did_you_mean, message_of
from tactograph.graph.rings import Ring, rings

NODE_DECORATOR = re.compile(rb"^@node\b", re.MULTILINE)
"""The decorator that distinguishes a node's file from a file of shared functions."""


@dataclass(frozen=True)
class NodePlace:
    """Where a node is declared: its module, its room, and the ring that brings it."""

    module: str
    room: str
    ring: Ring


def node_places() -> Mapping[str, NodePlace]:
    """The place of every node, by name; if two share a name the core's counts, then the first."""
    return {name: places[0] for name, places in _all_places(tuple(sys.path)).items()}


@cache
def _all_places(path: tuple[str, ...]) -> Mapping[str, list[NodePlace]]:
    """All places of every name on `path`, found without importing a module."""
    places: dict[str, list[NodePlace]] = {}
    for ring in rings():
        for file in ring.files("nodes", "**/[!_]*.py"):
            if NODE_DECORATOR.search(file.read_bytes()):
                module = ring.module("nodes", file)
                room = "/".join(module.removeprefix(f"{ring.package}.nodes.").split(".")[:-1])
                places.setdefault(file.stem, []).append(NodePlace(module, room, ring))
    return dict(sorted(places.items()))


def shipped_nodes() -> list[str]:
    """The names of the nodes that ship, in the core and in its rings."""
    return [name for name, place in node_places().items() if place.ring.shipped]


def node_names() -> list[str]:
    """All names that `find_node` knows."""
    return list(node_places())


def find_node(name: str, own: Mapping[str, Node] | None = None) -> Node:
    """Import and return the node called `name`, or take it from `own`.

    A shipped node has precedence over another package's node of that name, with a warning, so that
    graphs keep their meaning.  Raises InputError if no package has the node, or if two packages
    have it that do not ship; NodeError if its module does not define it.
    """
    if own and name in own:
        return own[name]
    places = _all_places(tuple(sys.path)).get(name, [])
    if not places:
        names = [*(own or ()), *node_names()]
        raise GraphError(
            f"no node is called '{name}'{did_you_mean(name, names, 'tactograph nodes')}"
        )
    first, *others = places
    packages = " and ".join(sorted(place.ring.distribution for place in others))
    if others and not first.ring.shipped:
        packages = " and ".join(sorted(place.ring.distribution for place in places))
        raise InputError(f"two nodes are called '{name}', in {packages}; uninstall one of them")
    if others:
        warnings.warn(
            f"'{name}' of {packages} is not used: a shipped node has that name; rename it "
            "there, or uninstall it",
            stacklevel=2,
        )
    return _load(name, first)


def _load(name: str, place: NodePlace) -> Node:
    """Import the node's module; an error in another package's module names that package."""
    if place.ring.shipped:
        return _checked(importlib.import_module(place.module), name)
    try:
        module = importlib.import_module(place.module)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # also SystemExit, which would end the command as a success
        raise NodeError(
            f"node '{name}' of package {place.ring.distribution} cannot be loaded: "
            f"{message_of(error) or type(error).__name__}"
        ) from error
    node = _checked(module, name)
    node.package = place.ring.distribution
    return node


def own_nodes(nodes: Iterable[Node]) -> dict[str, Node]:
    """The nodes that a program hands over, by name.

    Raises InputError if one is not a node, or has the name of a shipped or another node, so that
    graphs keep their meaning.
    """
    own: dict[str, Node] = {}
    shipped = {*shipped_nodes()}
    for each in nodes:
        if not isinstance(each, Node):
            raise InputError(f"nodes: {each!r} is not a node; decorate the function with @node")
        if each.name in shipped:
            raise InputError(f"nodes: a shipped node is called '{each.name}'; rename the function")
        if each.name in own:
            raise InputError(f"nodes: two are called '{each.name}'; rename one")
        own[each.name] = each
    return own


def _checked(module: object, name: str) -> Node:
    candidate = getattr(module, name, None)
    if not isinstance(candidate, Node) or candidate.name != name:
        raise NodeError(f"the module of node '{name}' defines no @node function of that name")
    return candidate
