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
    """A node's module, and those of other nodes and functions from which it imports names."""
    module = sys.modules[node.function.__module__]
    yield module
    names = {getattr(value, "__module__", None) or "" for value in vars(module).values()}
    yield from (sys.modules[name] for name in sorted(names) if name.startswith("tactograph.nodes."))


def shared_constants(node: Node) -> dict[str, tuple[float, float]]:
    """Constants with one name on both sides: the number in Python, and in the kernel's source.

    Two modules may each have a constant of that name; one of them has to agree.
    """
    shared: dict[str, tuple[float, float]] = {}
    for name, number in NUMBER.findall(kernel_source(node)):
        in_kernel = float(np.float32(number))
        in_python = [
            float(np.float32(getattr(m, name))) for m in modules_of(node) if hasattr(m, name)
        ]
        if in_python:
            shared[name] = (in_kernel if in_kernel in in_python else in_python[0]), in_kernel
    return shared


@each("name", KERNEL_NODES)
def test_both_sides_hold_the_same_constants(name: str) -> None:
    shared = shared_constants(find_node(name))
    assert {name: pair for name, pair in shared.items() if pair[0] != pair[1]} == {}


def test_constants_of_a_node_and_of_the_optics_are_compared() -> None:
    shared = shared_constants(find_node("label_lights"))
    assert {"AT_REST", "STRAY_LIGHT", "MAX_TURN_RAD", "MIN_NORMAL_Z"} <= shared.keys()
