"""A node that declares itself idle returns its neutral value to the bit."""

import inspect

import numpy as np
import pytest

from tactograph.graph.backends.parity_cases import cases, make_inputs
from tactograph.graph.declare.find_node import find_node, shipped_nodes

IDLE = [name for name in shipped_nodes() if find_node(name).is_idle is not None]


IDLE_AT = {"area": 1.0, "diffuse": 1.0, "film_gain": 1.0, "film_refraction": 1.0}
"""Values at which a node is idle, if not 0; the other one of 0 and 1 leaves it busy."""


def test_these_nodes_and_no_others_can_be_idle() -> None:
    distorting = ["distort_height", "distort_confidence", "distort_error", "distort_labels"]
    bent = ["matt_light", "undistort", "undo_perspective", "view_slope"]
    shaped = ["add_rest", "light_on_plane", "slope_from_rest"]
    further = ["doubt_penumbra", "edge_variance", "film_bounce", "sharpen_slope", "within_film"]
    assert sorted([*distorting, *bent, *shaped, *further]) == sorted(IDLE)


@pytest.mark.parametrize("name", IDLE)
def test_an_idle_node_returns_its_neutral_input_or_nothing(name: str) -> None:
    node = find_node(name)
    case = cases(node)[0]
    inputs, arguments = make_inputs(node, case), inspect.signature(node.is_idle).parameters
    ports = {port.replace(".", "_"): port for port in inputs}
    idle = {n: IDLE_AT.get(n, 0.0) for n, a in arguments.items() if a.default is a.empty}
    busy = {n: np.full_like(inputs[ports[n]], 1 - value) for n, value in idle.items()}
    # An input with a default is what has to be absent.
    assert not busy or not node.is_idle(**busy)
    values = {n: np.full_like(inputs[ports[n]], value) for n, value in idle.items()}
    assert node.is_idle(**values)
    inputs |= {ports[n]: values.get(n) for n in arguments}
    result = node(*node.in_order(inputs), **case.settings)
    if all(port.optional for port in node.outputs.values()):
        assert result is None
        return
    for output, plane in zip(
        node.outputs, result if isinstance(result, tuple) else [result], strict=True
    ):
        np.testing.assert_array_equal(plane, inputs[node.handed_on(output)])
