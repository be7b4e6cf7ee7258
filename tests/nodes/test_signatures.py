"""A node takes few arguments; values that belong together are a record."""

import inspect

from tactograph.graph.declare.find_node import find_node, shipped_nodes
from tests.each import each

MAX_INPUTS, MAX_PARAMS = 14, 11


def arguments(name: str) -> tuple[int, int]:
    """The inputs and the parameters of a node's function, a record counted as one."""
    node = find_node(name)
    engine = {node.provenance, node.session, node.wanted, node.integers, *node.calls}
    signature = inspect.signature(node.function).parameters.values()
    keyword_only = [p.kind is p.KEYWORD_ONLY for p in signature if p.name not in engine]
    return keyword_only.count(False), keyword_only.count(True)


@each("name", shipped_nodes())
def test_a_node_takes_few_arguments(name: str) -> None:
    inputs, params = arguments(name)
    assert inputs <= MAX_INPUTS
    assert params <= MAX_PARAMS
