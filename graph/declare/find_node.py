"""Find a node by the name a graph gives it.

Built-in nodes lie in the rooms of ``tactograph.nodes``: ``op: x`` is function ``x`` of
``nodes/ROOM/x.py``, where a room may lie in another.  Third-party nodes come through the
entry-point group ``tactograph.nodes`` (``x = package.module:x``).  Only the nodes that a graph
names are imported.
"""

import importlib
import importlib.util
import re
import sys
import warnings
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

import tactograph.nodes
from tactograph.graph.declare.node import Node
from tactograph.graph.errors import GraphError, InputError, NodeError, did_you_mean, message_of

ENTRY_POINT_GROUP = "tactograph.nodes"
NODE_DECORATOR = re.compile(rb"^@node\b", re.MULTILINE)
"""The decorator that tells a node's file from one of shared functions."""


@cache
def builtin_rooms() -> Mapping[str, str]:
    """The room of every built-in node, by the node's name; none of their modules is imported."""
    rooms: dict[str, str] = {}
    for root in map(Path, tactograph.nodes.__path__):
        for file in root.rglob("[!_]*.py"):
            if NODE_DECORATOR.search(file.read_bytes()):
                rooms[file.stem] = file.parent.relative_to(root).as_posix()
    return {name: rooms[name] for name in sorted(rooms)}


def builtin_names() -> list[str]:
    """The names of the built-in nodes."""
    return list(builtin_rooms())


def plugin_entry_points() -> Mapping[str, Sequence[EntryPoint]]:
    """The entry points of installed third-party packages, by node name; nothing is loaded."""
    return _entry_points(tuple(sys.path))


@cache
def _entry_points(path: tuple[str, ...]) -> Mapping[str, Sequence[EntryPoint]]:
    """The entry points on `path`, cached: reading all packages' metadata takes long."""
    points: dict[str, list[EntryPoint]] = {}
    for point in entry_points(group=ENTRY_POINT_GROUP):
        points.setdefault(point.name, []).append(point)
    return points


def node_names() -> list[str]:
    """All names that `find_node` knows."""
    return sorted({*builtin_names(), *plugin_entry_points()})


def find_node(name: str, own: Mapping[str, Node] | None = None) -> Node:
    """Import and return the node called `name`, or take it from `own`.

    A shipped node has precedence over a plug-in's of the same name, with a warning, so that graphs
    keep their meaning.  Raises InputError if no package has it, or several plug-ins have; NodeError
    if its module does not hold a node of that name.
    """
    if own and name in own:
        return own[name]
    points = plugin_entry_points().get(name, [])
    room = builtin_rooms().get(name)
    packages = " and ".join(sorted(map(_package, points)))
    if room is not None:
        if points:
            warnings.warn(
                f"'{name}' of {packages} is not used: a shipped node has that name; rename it "
                "there, or uninstall it",
                stacklevel=2,
            )
        module = importlib.import_module(f"{ENTRY_POINT_GROUP}.{room.replace('/', '.')}.{name}")
        return _checked(getattr(module, name, None), name)
    if not points:
        known = [*(own or ()), *node_names()]
        raise GraphError(
            f"no node is called '{name}'{did_you_mean(name, known, 'tactograph nodes')}"
        )
    if len(points) > 1:
        raise InputError(f"two nodes are called '{name}', in {packages}; uninstall one of them")
    return _plugin_node(points[0], name)


def _plugin_node(point: EntryPoint, name: str) -> Node:
    """Load the node of a third-party package."""
    try:
        loaded = point.load()
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # SystemExit, too: it would end the command as if it was done
        raise NodeError(
            f"node '{name}' of package {_package(point)} cannot be loaded: "
            f"{message_of(error) or type(error).__name__}"
        ) from error
    node = _checked(loaded, name)
    node.package = _package(point)
    # A plug-in's kernel lies in the package folder of the module that declares the node.
    spec = importlib.util.find_spec(point.module)
    is_package = spec is not None and spec.submodule_search_locations is not None
    folder = "" if is_package else point.module.rpartition(".")[0]
    node.kernel_package = folder or point.module
    return node


def own_nodes(nodes: Iterable[Node]) -> dict[str, Node]:
    """The nodes that a program hands over, by name.

    Raises InputError if one is no node, or has the name of a shipped or another node, so that
    graphs keep their meaning.
    """
    own: dict[str, Node] = {}
    for each in nodes:
        if not isinstance(each, Node):
            raise InputError(f"nodes: {each!r} is no node; decorate the function with @node")
        if each.name in builtin_rooms():
            raise InputError(f"nodes: a shipped node is called '{each.name}'; rename the function")
        if each.name in own:
            raise InputError(f"nodes: two are called '{each.name}'; rename one")
        own[each.name] = each
    return own


def _checked(candidate: object, name: str) -> Node:
    if not isinstance(candidate, Node) or candidate.name != name:
        raise NodeError(f"the module of node '{name}' defines no @node function of that name")
    return candidate


def _package(point: EntryPoint) -> str:
    return point.dist.name if point.dist else point.module.partition(".")[0]
