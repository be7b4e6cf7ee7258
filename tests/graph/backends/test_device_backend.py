"""A back end is a module of its folder and an entry in the list of names."""

import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from tactograph.graph.backends import device_backend
from tactograph.graph.backends.device_backend import open_device
from tactograph.graph.backends.device_queue import usual_lanes
from tactograph.graph.backends.devices import Device
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.plan.make_plan import make_plan
from tests.graph.conftest import SLOPES, graph_of

GPU = SimpleNamespace(backend="cuda", name="a GPU", lanes=1, is_cpu=False)


@pytest.fixture
def cuda(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("tactograph.graph.backends.cuda")
    module.open_device = lambda text, waits: (None, "no GPU") if text else (GPU, "")  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(device_backend, "BACKENDS", ("numpy", "cuda"))


def test_the_first_preferred_back_end_with_a_device_is_opened(cuda: None) -> None:
    assert open_device(["numpy", "cuda"]) == (GPU, "")
    assert open_device(["cuda"], "other") == (None, "no GPU")
    assert open_device(["numpy"]) == (None, "cuda is not among the preferred back ends")
    assert open_device(["numpy"], "other") == (None, "no GPU"), "a name asks for any back end"


def test_a_node_and_its_transfers_use_the_back_end_that_the_node_is_written_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    node = find_node("height_slopes")
    both = {**node.implementations, "cuda": node.kernels}
    monkeypatch.setattr(node, "implementations", both)
    graph = graph_of(SLOPES)
    graph = type(graph)(**{**vars(graph), "prefer": ("cuda", "opencl", "numpy")})
    plan = make_plan(graph, graph.placeholders, device=GPU)  # type: ignore[arg-type]
    assert plan.placements["slope"].backend == "cuda"
    assert plan.placements["again"].backend == "numpy"
    assert {s.backend for s in plan.steps if s.kind in ("upload", "download")} == {"cuda"}


@pytest.mark.parametrize(
    ("kind", "platform", "lanes"),
    [("CPU", "Portable Computing Language", 16), ("CPU", "rusticl", 1), ("GPU", "NVIDIA CUDA", 1)],
)
def test_work_items_process_several_elements_only_on_a_cpu_with_pocl(
    kind: str, platform: str, lanes: int
) -> None:
    handle: Any = SimpleNamespace(platform=SimpleNamespace(name=platform))
    assert usual_lanes(Device("", kind, handle, True, "works", False)) == lanes
