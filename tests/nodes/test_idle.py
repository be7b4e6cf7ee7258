"""What a node says of when it is idle holds to the bit."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

from tactograph.graph.backends.parity import cases, make_inputs
from tactograph.graph.declare.find_node import builtin_names, find_node

IDLE = [name for name in builtin_names() if find_node(name).is_idle is not None]


NOT_IDLE = {"within_film": 0.0}
"""What a node is at work on, where it is not 1; the other of the two leaves it idle."""


def test_a_lens_perspective_light_and_a_frame_full_of_film_make_nodes_idle() -> None:
    seen = ["as_seen", "confidence_as_seen", "error_as_seen", "labels_as_seen"]
    bent = ["undistort", "undo_perspective", "view_slope"]
    assert sorted([*seen, "film_bounce", *bent, "within_film"]) == sorted(IDLE)


@pytest.mark.parametrize("name", IDLE)
def test_an_idle_node_returns_its_neutral_input_or_nothing(name: str) -> None:
    node = find_node(name)
    case = cases(node)[0]
    inputs, asked = make_inputs(node, case), inspect.signature(node.is_idle).parameters
    ports = {port.replace(".", "_"): port for port in inputs}
    names = {n: ports[n] for n in asked}
    busy = NOT_IDLE.get(name, 1.0)
    assert not node.is_idle(**{n: np.full_like(inputs[port], busy) for n, port in names.items()})
    for port in names.values():
        inputs[port] = np.full_like(inputs[port], 1 - busy)
    assert node.is_idle(**{n: inputs[port] for n, port in names.items()})
    made = node(*node.in_order(inputs), **case.settings)
    if all(port.optional for port in node.outputs.values()):
        assert made is None
    else:
        np.testing.assert_array_equal(made, inputs[node.neutral])
