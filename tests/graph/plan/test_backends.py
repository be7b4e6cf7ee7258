"""Pass 4: where each node runs, and why; no fallback is silent."""

import importlib.util
from importlib.machinery import ModuleSpec

import pytest

from tactograph.graph import GraphError
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.plan.make_plan import make_plan
from tactograph.graph.plan.plan import Placement, Plan
from tests.graph.conftest import SLOPES, Write

ABSENT = "no OpenCL device works here"


def planned(file: str, device: OpenCL | None) -> Plan:
    graph = read_graph(file)
    return make_plan(graph, graph.placeholders, device=device, no_device=ABSENT)


def hide(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec

    def find_others(name: str, package: str | None = None) -> ModuleSpec | None:
        return None if name == module else find(name, package)

    monkeypatch.setattr(importlib.util, "find_spec", find_others)


@pytest.fixture
def without_vkfft(monkeypatch: pytest.MonkeyPatch) -> None:
    hide("pyvkfft", monkeypatch)


def test_a_node_with_a_kernel_runs_on_the_preferred_device(write: Write, device: OpenCL) -> None:
    plan = planned(write(SLOPES), device)
    assert plan.placements["slope"].backend == "opencl"
    assert plan.placements["slope"].why == "preferred"
    assert plan.device == device.name
    assert plan.fallbacks == []


@pytest.mark.slow
def test_work_that_the_host_does_faster_stays_there_without_a_fallback(
    write: Write, device: OpenCL, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Needs VkFFT, which 'make test-all' installs."""
    slopes = SLOPES.replace("integrate_dct", "integrate_frankot_chellappa")
    for is_cpu, backend in ((True, "numpy"), (False, "opencl")):
        monkeypatch.setattr(device, "is_cpu", is_cpu)
        placement = planned(write(slopes), device).placements["again"]
        assert (placement.backend, placement.fallback) == (backend, False)
    monkeypatch.setattr(device, "is_cpu", True)
    asked = planned(write(f"prefer: [opencl]{slopes}"), device).placements["again"]
    assert asked.backend == "opencl"


def test_a_node_without_a_kernel_runs_on_numpy_and_that_is_no_fallback(
    write: Write, device: OpenCL
) -> None:
    placement = planned(write(SLOPES), device).placements["height"]
    assert (placement.backend, placement.why) == ("numpy", "has no opencl kernel")
    assert not placement.fallback


def test_without_a_device_every_fallback_is_recorded_with_its_reason(write: Write) -> None:
    plan = planned(write(SLOPES), None)
    assert {p.backend for p in plan.placements.values()} == {"numpy"}
    plan.placements["height"] = Placement("opencl", "preferred")
    assert plan.fallbacks == [f"slope, again run on numpy: opencl is preferred, but {ABSENT}"]


@pytest.mark.parametrize("graph", ["paper", "reconstruct"])
def test_one_line_reports_that_every_node_falls_back(graph: str) -> None:
    plan = planned(graph, None)
    reason = f"numpy: opencl is preferred, but {ABSENT}"
    assert plan.fallbacks == [f"every node runs on {reason}"]


def test_of_many_nodes_that_fall_back_the_first_are_named_and_all_counted() -> None:
    """Where others run on the device, or fell back for another reason, it is not every node."""
    plan = planned("reconstruct", None)
    fallen = [name for name, placement in plan.placements.items() if placement.fallback]
    many = (
        f"{len(fallen) - 1} nodes ({', '.join(fallen[:3])}, …) run on numpy: opencl is preferred, "
        f"but {ABSENT}; 'tactograph explain' lists them"
    )
    plan.placements[fallen[-1]] = Placement("opencl", "preferred")
    assert plan.fallbacks == [many]
    plan.placements[fallen[-1]] = Placement("numpy", "a part is missing", fallback=True)
    assert plan.fallbacks == [many, f"{fallen[-1]} runs on numpy: a part is missing"]


def test_numpy_is_a_fallback_even_if_only_opencl_is_preferred(write: Write) -> None:
    plan = planned(write(SLOPES.replace("nodes:", "prefer: [opencl]\nnodes:", 1)), None)
    assert plan.fallbacks[0] == f"every node runs on numpy: opencl was asked for, but {ABSENT}"


def test_if_numpy_is_preferred_nothing_falls_back(write: Write, device: OpenCL) -> None:
    text = SLOPES.replace("nodes:", "prefer: [numpy, opencl]\nnodes:", 1)
    for each in (device, None):
        plan = planned(write(text), each)
        assert {p.backend for p in plan.placements.values()} == {"numpy"}
        assert plan.fallbacks == []


def test_a_library_that_is_missing_is_named_with_its_remedy(
    write: Write, device: OpenCL, without_vkfft: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(device, "lanes", 1)
    plan = planned(write(SLOPES), device)
    assert plan.placements["slope"].backend == "opencl"
    assert plan.fallbacks == [
        "again runs on numpy: opencl is preferred, but pyvkfft is not installed "
        "(pip install 'tactograph[vkfft]')"
    ]


def test_an_unused_library_is_not_needed(write: Write, device: OpenCL, without_vkfft: None) -> None:
    """Neither where the kernels do it in lanes, nor where the host does it all."""
    assert device.lanes > 1
    other = write(SLOPES.replace("integrate_dct", "integrate_frankot_chellappa"), "other.yaml")
    here, there = planned(write(SLOPES), device), planned(other, device)
    assert here.placements["again"].backend == "opencl"
    assert there.placements["again"].why.startswith("faster than on the device")
    assert here.fallbacks == there.fallbacks == []


def test_a_bound_node_stays_where_it_is_bound(write: Write, device: OpenCL, backend: str) -> None:
    other = "opencl" if backend == "numpy" else "numpy"
    text = SLOPES.replace("{op: height_slopes", f"{{backend: {backend}, op: height_slopes")
    plan = planned(write(text.replace("nodes:", f"prefer: [{other}]\nnodes:", 1)), device)
    assert plan.placements["slope"].backend == backend
    assert plan.placements["slope"].why == "the graph file says so"
    assert plan.fallbacks == []


@pytest.mark.parametrize(
    ("op", "message"),
    [
        ("height_slopes", f"9:12: nodes.slope.backend: 'slope' is bound to opencl, but {ABSENT}"),
        ("pixel_size", "'pixel' is bound to opencl, but node 'pixel_size' has no opencl kernel"),
    ],
)
def test_a_node_bound_to_what_cannot_run_it_is_refused(write: Write, op: str, message: str) -> None:
    with pytest.raises(GraphError) as caught:
        planned(write(SLOPES.replace(f"{{op: {op}", f"{{backend: opencl, op: {op}")), None)
    assert message in str(caught.value)


def test_a_bound_node_whose_library_is_missing_is_refused(
    write: Write, device: OpenCL, without_vkfft: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(device, "lanes", 1)
    text = SLOPES.replace("{op: integrate_dct", "{backend: opencl, op: integrate_dct")
    with pytest.raises(GraphError, match="bound to opencl, but pyvkfft is not installed"):
        planned(write(text), device)


def test_a_constant_is_placed_with_its_readers(device: OpenCL) -> None:
    for name, placed in (("opencl", device), ("numpy", None)):
        placement = planned("paper_no_shadow", placed).placements["shadow"]
        assert placement.backend == name
        assert placement.why == "neutral: a constant stands in"
        assert not placement.fallback
