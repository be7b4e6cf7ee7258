"""What a node says of when it is idle holds to the bit."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

from tactograph.graph.declare.find_node import builtin_names, find_node
from tactograph.graph.declare.parity import by_port, cases, make_inputs

IDLE = [name for name in builtin_names() if find_node(name).is_idle is not None]


def test_lenses_and_perspective_are_what_nodes_are_idle_without() -> None:
    seen = ["as_seen", "confidence_as_seen", "labels_as_seen"]
    assert [*seen, "undistort", "undo_perspective", "view_slope"] == IDLE


@pytest.mark.parametrize("name", IDLE)
def test_an_idle_node_returns_its_neutral_input(name: str) -> None:
    node = find_node(name)
    case = cases(node)[0]
    inputs, names = make_inputs(node, case), inspect.signature(node.is_idle).parameters
    assert not node.is_idle(**{n: np.ones_like(inputs[n]) for n in names})
    for n in names:
        inputs[n] = np.zeros_like(inputs[n])
    assert node.is_idle(**{n: inputs[n] for n in names})
    (made,) = by_port(node, node(*inputs.values(), **case.settings)).values()
    np.testing.assert_array_equal(made, inputs[node.neutral])
