"""Any node, by the name that a graph gives it: ``from tactograph.sdk.nodes import coarsen``.

A node is called like the NumPy function that it declares.
"""

from typing import Any

from tactograph.graph.declare.find_node import find_node, node_names
from tactograph.graph.errors import GraphError


def __dir__() -> list[str]:
    return node_names()


def __getattr__(name: str) -> Any:
    if name.startswith("__"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return find_node(name)
    except GraphError as error:
        raise AttributeError(str(error)) from None
