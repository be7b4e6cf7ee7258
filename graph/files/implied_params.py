"""Params that a graph need not state, because a node's parameter has the same name.

``with: {crop: $crop}`` makes `crop` a param of the graph, with the kind, the default and the help
of the node's parameter `crop`.  Under another name (``with: {folder: $crop}``) it has to be stated,
so that a typo is found.
"""

import typing
from dataclasses import replace
from pathlib import Path
from typing import Any

from tactograph.graph.declare.annotations import members_of_tuples, parts_of
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.declare.parameter import Parameter
from tactograph.graph.errors import GraphError, InputError
from tactograph.graph.files.flat_graph import Entry, Graph, Param


def with_implied_params(graph: Graph) -> Graph:
    """Add the params that nodes take under the names of their parameters.

    Raises GraphError if nodes differ in kind or default of such a param.
    """
    implied: dict[str, Param] = {}
    for entry in graph.nodes.values():
        for name, value in entry.settings.items():
            if value != f"${name}" or name in graph.params:
                continue
            param = _param_of(graph, entry, name)
            first = implied.setdefault(name, param) if param else None
            if param and first and (first.kind, first.state) != (param.kind, param.state):
                raise GraphError(
                    f"{entry.where(f'with.{name}')}: '{name}' is {param.kind}, {param.state}, for "
                    f"{entry.op}, but {first.kind}, {first.state}, for another node; state it "
                    "under 'params'"
                )
    return replace(graph, params={**graph.params, **implied})


def _param_of(graph: Graph, entry: Entry, name: str) -> Param | None:
    """The param that matches a node's parameter; None if the plan will refuse the node."""
    try:
        node = find_node(entry.op, graph.own)
    except InputError:
        return None
    parameter = node.parameters.get(name)
    if parameter is None or not (kind := _kind_of(parameter)):
        return None
    default = None if parameter.required else _plain(parameter.default)
    return Param(kind, node.about.arguments[name].replace("``", ""), parameter.required, default)


def _kind_of(parameter: Parameter) -> str:
    """The kind of param that covers all values of a parameter; "" if there is none."""
    parts = parts_of(parameter.annotation)
    if members := members_of_tuples(parts):
        return "numbers" if {int, float} & {*members} else "text"
    kinds = {Path: "path", bool: "flag", float: "number", int: "integer", str: "text"}
    matches = [kind for type_, kind in kinds.items() if type_ in parts]
    is_literal = any(typing.get_origin(part) is typing.Literal for part in parts)
    return matches[0] if matches else "text" * is_literal


def _plain(default: Any) -> Any:
    """A default as a graph file states it."""
    if isinstance(default, tuple):
        words = [_plain(each) for each in default]
        return ",".join(words) if words and isinstance(words[0], str) else words
    return str(default) if isinstance(default, Path) else default
