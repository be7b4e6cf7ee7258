"""Pass 4: where each node runs, and why; no fallback is silent."""

from __future__ import annotations

import importlib
import importlib.util
from importlib.machinery import ModuleSpec
from types import ModuleType

import pytest

from tactograph.graph import GraphError
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.declare.find_node import builtin_names, find_node
from tactograph.graph.files.read import read_graph
from tactograph.graph.plan.make_plan import make_plan
from tactograph.graph.plan.plan import Plan
from tactograph.graph.run.open import placeholders
from tests.graph.conftest import SLOPES, Write

ABSENT = "no OpenCL device works here"


def planned(file: str, device: OpenCL | None) -> Plan:
    graph = read_graph(file)
    return make_plan(graph, placeholders(graph), device=device, no_device=ABSENT)


def hide(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec

    def find_others(name: str, package: str | None = None) -> ModuleSpec | None:
        return None if name == module else find(name, package)

    monkeypatch.setattr(importlib.util, "find_spec", find_others)


@pytest.fixture
def without_vkfft(monkeypatch: pytest.MonkeyPatch) -> None:
    hide("pyvkfft", monkeypatch)


@pytest.fixture
def without_numba(monkeypatch: pytest.MonkeyPatch) -> None:
    hide("numba", monkeypatch)


def test_a_node_with_a_kernel_runs_on_the_device_that_is_preferred(
    write: Write, device: OpenCL
) -> None:
    plan = planned(write(SLOPES), device)
    assert plan.placements["slope"].backend == "opencl"
    assert plan.placements["slope"].why == "preferred"
    assert plan.device == device.name
    assert plan.fallbacks == []


def test_what_the_host_does_faster_than_a_cpu_device_stays_there_and_that_is_no_fallback(
    write: Write, device: OpenCL, monkeypatch: pytest.MonkeyPatch
) -> None:
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
    assert (placement.backend, placement.why) == (
        "numpy",
        "has no OpenCL kernel and no numba function",
    )
    assert not placement.fallback


def test_without_a_device_every_fallback_is_recorded_with_its_reason(write: Write) -> None:
    plan = planned(write(SLOPES), None)
    assert {p.backend for p in plan.placements.values()} == {"numpy"}
    assert plan.fallbacks == [
        f"slope, again run on numpy: opencl is preferred, but {ABSENT}",
    ]


def test_if_nothing_but_opencl_will_do_numpy_is_a_fallback_too(write: Write) -> None:
    plan = planned(write(SLOPES.replace("nodes:", "prefer: [opencl]\nnodes:", 1)), None)
    assert plan.fallbacks[0] == f"slope, again run on numpy: opencl was asked for, but {ABSENT}"


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


def test_a_library_that_would_not_be_used_is_not_asked_for(
    write: Write, device: OpenCL, without_vkfft: None
) -> None:
    """Neither where the kernels do it in lanes, nor where the host does it all."""
    assert device.lanes > 1
    other = write(SLOPES.replace("integrate_dct", "integrate_frankot_chellappa"), "other.yaml")
    here, there = planned(write(SLOPES), device), planned(other, device)
    assert here.placements["again"].backend == "opencl"
    assert there.placements["again"].why.startswith("faster than on a CPU device")
    assert here.fallbacks == there.fallbacks == []


@pytest.mark.parametrize("backend", ["numpy", "opencl"])
def test_a_node_that_is_bound_stays_where_it_is_bound(
    write: Write, device: OpenCL, backend: str
) -> None:
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
        ("pixel_size", "'pixel' is bound to opencl, but node 'pixel_size' has no OpenCL kernel"),
    ],
)
def test_a_node_that_is_bound_to_what_cannot_run_it_is_refused(
    write: Write, op: str, message: str
) -> None:
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


LIGHT = """
format: 1
params: {calibration: {kind: path}, capture: {kind: path}}
nodes:
  frames: {op: read_capture, with: {folder: $capture}}
  cal:    {op: read_calibration, with: {file: $calibration}}
  light:  {op: flat_field, in: {image: frames.image, flat: cal.flat, dark: cal.dark}}
  lit:    {op: label_lit, in: {light: light}}
outputs: {lit: lit}
"""
"""`light` is written for all back ends, `lit` has no numba function."""


def test_without_a_device_what_has_a_numba_function_is_compiled(write: Write) -> None:
    plan = planned(write(LIGHT), None)
    assert plan.placements["light"].backend == "numba"
    assert plan.fallbacks == [
        f"light runs on numba: opencl is preferred, but {ABSENT}",
        f"lit runs on numpy: opencl is preferred, but {ABSENT}",
    ]


def test_with_a_device_nobody_asks_for_numba(
    write: Write, device: OpenCL, without_numba: None
) -> None:
    plan = planned(write(LIGHT), device)
    assert plan.placements["light"].backend == "opencl"
    assert plan.fallbacks == []


def test_a_node_with_a_numba_function_has_a_kernel_too() -> None:
    """Else one with a device would be told to install numba."""
    for name in builtin_names():
        assert "numba" not in find_node(name).backends or find_node(name).has_kernel, name


def test_with_neither_device_nor_numba_both_reasons_are_told(
    write: Write, without_numba: None
) -> None:
    plan = planned(write(LIGHT), None)
    assert {p.backend for p in plan.placements.values()} == {"numpy"}
    assert plan.fallbacks == [
        f"light runs on numpy: opencl is preferred, but {ABSENT}; "
        "numba is next, but numba is not installed (pip install 'tactograph[numba]')",
        f"lit runs on numpy: opencl is preferred, but {ABSENT}",
    ]


def test_a_numba_that_cannot_be_imported_is_not_used(
    write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    load = importlib.import_module

    def load_others(name: str, package: str | None = None) -> ModuleType:
        if name == "numba":
            raise ImportError("Numba needs NumPy 2.5 or less")
        return load(name, package)

    monkeypatch.setattr(importlib, "import_module", load_others)
    light = planned(write(LIGHT), None).fallbacks[0]
    assert "numba is next, but numba cannot be imported: Numba needs NumPy 2.5 or less" in light


def test_if_numba_is_preferred_nodes_without_a_function_are_no_fallback(write: Write) -> None:
    plan = planned(write(f"prefer: [numba]{LIGHT}"), None)
    assert plan.placements["light"].why == "preferred"
    assert plan.placements["lit"].why == "has no numba function"
    assert plan.fallbacks == []


def test_numba_and_numpy_share_their_memory(write: Write, device: OpenCL) -> None:
    for prefer in ("numba", "numba, numpy"):
        plan = planned(write(f"prefer: [{prefer}]{LIGHT}"), device)
        assert {step.kind for step in plan.steps} == {"run"}


def test_what_is_bound_to_numba_and_cannot_be_compiled_is_refused(
    write: Write, without_numba: None
) -> None:
    for node, why in (("flat_field", "numba is not installed"), ("label_lit", "no numba function")):
        text = LIGHT.replace(f"{{op: {node}", f"{{backend: numba, op: {node}")
        with pytest.raises(GraphError, match=f"is bound to numba, but .*{why}"):
            planned(write(text), None)


def test_a_constant_stands_where_its_readers_are(device: OpenCL) -> None:
    for name, placed in (("opencl", device), ("numpy", None)):
        placement = planned("paper_no_shadow", placed).placements["shadow"]
        assert placement.backend == name
        assert placement.why == "neutral: a constant stands in"
        assert not placement.fallback
