"""A node takes what a reader can hold in mind; what belongs together is a record."""

import inspect

from tactograph.graph.declare.find_node import find_node, shipped_nodes
from tests.each import each

MAX_INPUTS, MAX_PARAMS = 14, 11


def arguments(name: str) -> tuple[int, int]:
    """The inputs and the parameters of a node's function, a record counted as one."""
    node = find_node(name)
    engine = {node.provenance, node.session, node.wanted, node.whole, *node.calls}
    signature = inspect.signature(node.function).parameters.values()
    given = [p.kind is p.KEYWORD_ONLY for p in signature if p.name not in engine]
    return given.count(False), given.count(True)


@each("name", shipped_nodes())
def test_a_node_takes_few_arguments(name: str) -> None:
    inputs, params = arguments(name)
    assert inputs <= MAX_INPUTS
    assert params <= MAX_PARAMS
