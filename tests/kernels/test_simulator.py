"""Kernels under oclgrind: no race, no access out of bounds, no uninitialised read."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tactograph.graph.backends.kernel_source import kernel_source
from tactograph.graph.declare.find_node import builtin_names, find_node

SCRIPT = """
import ast
import sys
from tactograph.graph.backends import compiled_node, launch, opencl
from tactograph.graph.backends.devices import choose_device
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.declare.parity import cases, compare
from tactograph.nodes.height import _height_solver

name, lanes, shape, before, after = sys.argv[1:6]
# A work-item takes a simulator as long as a pixel: fewer of them race as many do.
launch.Launch.group = property(lambda run: 1 if run.lanes > 1 else 16)
_height_solver.PARTS, _height_solver.GROUP = 64, 32
text = compiled_node.kernel_source
compiled_node.kernel_source = lambda node: (
    text(node)
    .replace("#define GROUP 128", "#define GROUP 16")
    .replace("#define PARTS 1024", "#define PARTS 64")
)
device = opencl.OpenCL(choose_device("oclgrind")[0], lanes=int(lanes))
if before:
    source = compiled_node.kernel_source
    compiled_node.kernel_source = lambda node: source(node).replace(before, after)
node = find_node(name)
small = cases(node, shapes=((1, 1), (3, 5)))[:8]
for case in cases(node, shapes=(ast.literal_eval(shape),))[:1] if shape else small:
    wrong = compare(node, device, case)
    assert wrong is None or before, f"{case}: {wrong}"
"""
# Optimised, a kernel holds vector shuffles that the simulator fails on, and fewer reads.
AS_WRITTEN = {"PYOPENCL_NO_CACHE": "1", "PYOPENCL_BUILD_OPTIONS": "-cl-opt-disable"}
NODES = [find_node(name) for name in builtin_names() if find_node(name).has_kernel]
VKFFT = ("integrate_dct", "integrate_frankot_chellappa")
"""With one lane; its own kernels are not ours to prove, and take minutes in a simulator."""
OURS = [node.name for node in NODES if node.name not in VKFFT]
LANED = [node.name for node in NODES if "LANES" in kernel_source(node)]


def simulate(
    name: str,
    log: Path,
    before: str = "",
    after: str = "",
    lanes: int = 1,
    shape: tuple[int, int] | None = None,
) -> str:
    """Run a node's small parity cases, or one of `shape`, and return what the simulator says."""
    checks = {"OCLGRIND_DATA_RACES": "1", "OCLGRIND_LOG": str(log)}
    if lanes == 1:  # the check does not know the built-in functions of 16 lanes
        checks["OCLGRIND_UNINITIALIZED"] = "1"
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, name, str(lanes), str(shape or ""), before, after],
        env={**os.environ, **checks, **AS_WRITTEN},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return log.read_text() if log.is_file() else ""


@pytest.mark.parametrize("name", OURS)
def test_a_kernel_is_clean(name: str, tmp_path: Path) -> None:
    assert simulate(name, tmp_path / "log") == ""


@pytest.mark.parametrize("name", LANED)
def test_a_kernel_of_many_lanes_is_clean(name: str, tmp_path: Path) -> None:
    assert simulate(name, tmp_path / "log", lanes=16) == ""


@pytest.mark.parametrize("name", LANED)
def test_a_kernel_whose_lanes_are_filled_is_clean(name: str, tmp_path: Path) -> None:
    """A row is longer than the lanes, and the image than a run of label_lights."""
    assert simulate(name, tmp_path / "log", lanes=16, shape=(4, 17)) == ""


def test_an_image_that_is_turned_over_is_clean(tmp_path: Path) -> None:
    assert simulate("integrate_dct", tmp_path / "log", lanes=16, shape=(67, 18)) == ""


def test_the_simulator_notices_an_access_out_of_bounds(tmp_path: Path) -> None:
    log = simulate("flat_field", tmp_path / "log", "image + i", "image + i + K * H * W")
    assert "Invalid read" in log


def test_the_simulator_notices_a_race(tmp_path: Path) -> None:
    log = simulate("shadow_linear", tmp_path / "log", "out + i, count", "out, count")
    assert "race" in log
