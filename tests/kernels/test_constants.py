"""A constant that stands in Python and in OpenCL C under one name is the same number in both."""

import re
import sys
from collections.abc import Iterator
from types import ModuleType

import numpy as np

from tactograph.graph.backends.kernel_source import kernel_source
from tactograph.graph.declare.find_node import find_node, shipped_nodes
from tactograph.graph.declare.node import Node
from tests.each import each

NUMBER = re.compile(r"^#define (\w+) (-?[\d.]+(?:e-?\d+)?)f?$", re.MULTILINE)
KERNEL_NODES = [name for name in shipped_nodes() if find_node(name).has_kernel]


def modules_of(node: Node) -> Iterator[ModuleType]:
    """A node's module, and those of other nodes and functions that it takes names from."""
    own = sys.modules[node.function.__module__]
    yield own
    taken = {getattr(value, "__module__", None) or "" for value in vars(own).values()}
    yield from (sys.modules[name] for name in sorted(taken) if name.startswith("tactograph.nodes."))


def shared_constants(node: Node) -> dict[str, tuple[float, float]]:
    """What both sides call by one name: the number in Python, and that in the kernel's source.

    Two modules may each have a constant of that name; one of them has to agree.
    """
    found: dict[str, tuple[float, float]] = {}
    for name, number in NUMBER.findall(kernel_source(node)):
        there = float(np.float32(number))
        here = [float(np.float32(getattr(m, name))) for m in modules_of(node) if hasattr(m, name)]
        if here:
            found[name] = (there if there in here else here[0]), there
    return found


@each("name", KERNEL_NODES)
def test_both_sides_hold_the_same_constants(name: str) -> None:
    shared = shared_constants(find_node(name))
    assert {name: pair for name, pair in shared.items() if pair[0] != pair[1]} == {}


def test_constants_of_a_node_and_of_the_optics_are_compared() -> None:
    shared = shared_constants(find_node("label_lights"))
    assert {"AT_REST", "STRAY_LIGHT", "MAX_TURN_RAD", "MIN_NORMAL_Z"} <= shared.keys()
