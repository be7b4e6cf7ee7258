"""Change single settings of a graph, for a command line or a program."""

import os
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from tactograph.graph.declare.check_settings import PARAM_PLACEHOLDER, check_settings
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.disk.strict_yaml import Place
from tactograph.graph.errors import ErrorsTogether, GraphError, InputError
from tactograph.graph.files.apply_patch import apply_patch
from tactograph.graph.files.flat_graph import Graph


def with_changes(graph: Graph, changes: Mapping[str, Any], origin: str = "--set") -> Graph:
    """Apply ``node.param=value`` changes, like `set` of a patch.

    `origin` names where the changes come from in messages.  Raises GraphError if a change names no
    node of the graph, or if a node does not accept a value, whether or not the run needs that node.
    """
    before = graph.nodes
    for target, value in changes.items():
        node_id, dot, setting = target.rpartition(".")
        if not dot or not node_id or not setting:
            raise InputError(f"{origin} {target}: write it as node.param=value")
        places = {"": Place(origin, 0, 0, target)}
        change = {"set": node_id, "settings": {setting: plain(value)}}
        graph = apply_patch(graph, change, places)
    changed = [name for name, entry in graph.nodes.items() if entry != before.get(name)]
    ErrorsTogether.of_all(changed, partial(_check, graph))
    return graph


def _check(graph: Graph, name: str) -> None:
    entry = graph.nodes[name]
    try:
        node = find_node(entry.op, graph.own)
    except GraphError:  # the plan reports it at its place
        return
    settings = {**entry.settings, **dict.fromkeys(entry.params, PARAM_PLACEHOLDER)}
    check_settings(node, settings, lambda setting: entry.where(f"with.{setting}"))


def plain(value: Any) -> Any:
    """The value as a graph file would hold it: plain numbers for NumPy's, text for paths."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return [plain(each) for each in value] if isinstance(value, list | tuple) else value
