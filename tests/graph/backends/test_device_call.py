"""A node that a node on the host calls runs on the device as it does on the host."""

from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import Node, NodeError, load
from tactograph.graph.backends.device_call import DeviceCall
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.cache import result_origin, store
from tactograph.graph.cache.result_origin import code_of
from tactograph.graph.cache.store import recall_or_make
from tactograph.graph.disk import disk_cache
from tactograph.nodes.light.film_bounce import film_bounce
from tests.graph.conftest import graph_of
from tests.graph.plan.test_backends import ABSENT, planned
from tests.graph.toys import bright, halves, leaned, lower_half, strips
from tests.nodes.films import MATT

GRAPH = """
format: 1
params: {count: {kind: integer, default: 1}}
prefer: [opencl, numpy]
nodes:
  frames: {op: touches, with: {count: $count}}
  half: {op: lower_half, in: {image: frames.image}}
outputs: {half: half}
"""
IMAGE = np.random.default_rng(0).uniform(0, 3, (4, 6, 8)).astype(np.float32)
TABLE = np.arange(3, dtype=np.float32)


@pytest.mark.parametrize(
    ("node", "inputs", "settings"),
    [
        (halves, (IMAGE,), {}),
        (leaned, (IMAGE, TABLE), {}),
        (leaned, (IMAGE,), {}),
        (leaned, (IMAGE, None), {}),
        (strips, (IMAGE,), {"rows": 3}),
        (bright, (IMAGE,), {}),
        (bright, (IMAGE,), {"above": 2.5}),
    ],
    ids=lambda value: value.name if isinstance(value, Node) else "",
)
def test_a_device_call_returns_what_the_node_returns(
    device: OpenCL, node: Node, inputs: tuple[object, ...], settings: dict[str, object]
) -> None:
    result = DeviceCall(node, device)(*inputs, **settings)
    expected = node(*inputs, **settings)
    assert type(result) is type(expected)
    for one, other in zip(node.results(result), node.results(expected), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6)


@pytest.mark.parametrize("albedo", [0.0, 0.6])
def test_a_record_is_split_into_its_fields_and_an_idle_node_stays_idle(
    device: OpenCL, albedo: float
) -> None:
    height = np.zeros(IMAGE.shape[1:], np.float32)
    height[2:4, 2:6] = 0.5
    inputs = IMAGE, height, MATT._replace(albedo=albedo), 0.2
    result, expected = DeviceCall(film_bounce, device)(*inputs), film_bounce(*inputs)
    if albedo == 0:
        assert result is None
        assert expected is None
    else:
        np.testing.assert_allclose(result, expected, atol=1e-5)


def test_inputs_of_two_sizes_are_refused(device: OpenCL) -> None:
    bounce, narrow = DeviceCall(film_bounce, device), np.zeros((6, 5), np.float32)
    with pytest.raises(NodeError, match="film_bounce: W is 5 in 'height', not 8"):
        bounce(IMAGE, narrow, MATT._replace(albedo=0.6), 0.2)


def test_the_graph_chooses_the_back_end_of_a_called_node(toys: list[str], device: OpenCL) -> None:
    bound = GRAPH.replace("op: lower_half,", "op: lower_half, backend: numpy,")
    for text, backend, on_host in (
        (GRAPH, None, False),
        (GRAPH, "numpy", True),
        (bound, None, True),
    ):
        toys.clear()
        (out,) = load(graph_of(text), backend=backend).items()
        np.testing.assert_array_equal(out["half"], np.float32(0.5))
        assert ("low" in toys) == on_host


def test_the_plan_states_the_back_end_of_a_called_node(toys: list[str], device: OpenCL) -> None:
    placement = planned(graph_of(GRAPH), device).placements["half"]
    assert (placement.backend, placement.fallback) == ("numpy", False)
    assert placement.why == "has no opencl kernel; calls halves on opencl"
    fallen = planned(graph_of(GRAPH), None)
    assert fallen.fallbacks == [f"half runs on numpy: opencl is preferred, but {ABSENT}"]


def test_a_result_of_the_device_is_not_recalled_for_the_host(
    device: OpenCL, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(disk_cache.FOLDER_VARIABLE, str(tmp_path))
    monkeypatch.setattr(store, "MIN_STORED_MS", -1.0)
    calls: list[str] = []

    def make() -> np.ndarray:
        calls.append("make")
        return IMAGE

    for keywords in (
        {"halve": DeviceCall(halves, device)},
        {"halve": DeviceCall(halves, device)},
        {},
    ):
        recall_or_make(lower_half, keywords, [IMAGE], make)
    assert len(calls) == 2


def test_the_code_of_a_node_includes_the_kernels_of_the_nodes_that_it_calls(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    before = code_of(lower_half)
    monkeypatch.setattr(result_origin, "kernel_source", lambda node: "another")
    assert code_of(lower_half) != before
