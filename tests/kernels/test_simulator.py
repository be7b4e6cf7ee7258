"""Kernels under oclgrind: no race, no access out of bounds, no uninitialised read."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tactograph.graph.backends.kernel_source import kernel_source
from tactograph.graph.declare.find_node import find_node, shipped_nodes

SCRIPT = """
import gc
import json
import math
import os
import sys
from tactograph.graph.backends import compiled_node, opencl, programs
from tactograph.graph.backends.devices import choose_device
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.backends.parity import compare
from tactograph.graph.backends.parity_cases import cases
from tactograph.nodes.height import height_networks
from tactograph.nodes.optics import radiosity

# A work-item takes a simulator as long as a pixel: fewer of them race as many do.
height_networks.SUM_PARTS = 64
radiosity.MAX_RIM_CELLS = 4  # cells of film beyond a frame that has fewer
FILLS = ("random", "edges", "nan")  # edges hold zeros, too
text = compiled_node.kernel_source
simulator = choose_device("oclgrind")[0]


def check(name, lanes, shape, before, after):
    def source(node):
        smaller = text(node).replace("#define SUM_PARTS 1024", "#define SUM_PARTS 64")
        return smaller.replace(before, after) if before else smaller

    compiled_node.kernel_source = source
    # So few steps go no farther, and reads beyond are noticed.
    radiosity.SWEEP_MARGIN_CELLS = 3 + math.isqrt(lanes)
    device, node = opencl.OpenCL(simulator, lanes=lanes), find_node(name)
    device.group = min(device.group, 16)
    wide = {case.fill: case for case in cases(node, shapes=((3, 5),)) if case.setting == "default"}
    small = [cases(node, shapes=((1, 1),))[0], *(wide[f] for f in FILLS if f in wide)]
    for case in cases(node, shapes=(shape,))[:1] if shape else small:
        wrong = compare(node, case, device)
        if wrong is not None and not before:
            return f"{case}: {wrong}"
    return ""


for line in sys.stdin:
    job = json.loads(line)
    os.environ.update(job.pop("checks"))
    answer = check(**job)
    # A context reads what to check when it opens, and ends its log when it closes.
    programs.build.cache_clear()
    programs.context_of.cache_clear()
    gc.collect()
    print(json.dumps(answer), flush=True)
"""
# Optimised, a kernel holds vector shuffles that the simulator fails on, and fewer reads.
AS_WRITTEN = {"PYOPENCL_NO_CACHE": "1", "PYOPENCL_BUILD_OPTIONS": "-cl-opt-disable"}
NODES = [find_node(name) for name in shipped_nodes() if find_node(name).has_kernel]
VKFFT = ("integrate_dct", "integrate_frankot_chellappa")
"""Nodes that use VkFFT with one lane; its kernels are not tested here, and take minutes."""
OURS = [node.name for node in NODES if node.name not in VKFFT]
LANED = [node.name for node in NODES if "LANES" in kernel_source(node)]


Simulate = Callable[..., str]
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def simulator() -> Iterator[subprocess.Popen[str]]:
    """A process that checks one kernel after another."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    command, environment = [sys.executable, "-c", SCRIPT], {**os.environ, **AS_WRITTEN}
    with subprocess.Popen(command, env=environment, **pipes) as process:
        yield process
        process.stdin.close()


@pytest.fixture
def simulate(simulator: subprocess.Popen[str], tmp_path: Path) -> Simulate:
    """Run a node's small parity cases, or one of `shape`, and return the simulator's log."""

    def run(name: str, before: str = "", after: str = "", lanes: int = 1, shape: Any = None) -> str:
        log = tmp_path / "log"
        checks = {"OCLGRIND_DATA_RACES": "1", "OCLGRIND_LOG": str(log)}
        # One check does not know the built-in functions of 16 lanes.
        checks["OCLGRIND_UNINITIALIZED"] = "1" if lanes == 1 else "0"
        job = {"name": name, "lanes": lanes, "shape": shape, "before": before, "after": after}
        assert simulator.stdout is not None
        simulator.stdin.write(json.dumps({**job, "checks": checks}) + "\n")
        simulator.stdin.flush()
        patience = threading.Timer(300, simulator.kill)
        patience.start()
        answer = simulator.stdout.readline()
        patience.cancel()
        assert answer, "the simulator died, or took five minutes"
        assert json.loads(answer) == ""
        return log.read_text() if log.is_file() else ""

    return run


@pytest.mark.parametrize("name", OURS)
def test_a_kernel_is_clean(name: str, simulate: Simulate) -> None:
    assert simulate(name) == ""


@pytest.mark.parametrize("name", LANED)
def test_a_kernel_of_many_lanes_is_clean(name: str, simulate: Simulate) -> None:
    assert simulate(name, lanes=16) == ""


@pytest.mark.parametrize("name", LANED)
def test_a_kernel_whose_lanes_are_filled_is_clean(name: str, simulate: Simulate) -> None:
    """A row is longer than the lanes, and the image than a run of label_lights."""
    assert simulate(name, lanes=16, shape=(4, 17)) == ""


def test_an_image_that_is_turned_over_is_clean(simulate: Simulate) -> None:
    assert simulate("integrate_dct", lanes=16, shape=(67, 18)) == ""


@pytest.mark.parametrize(
    ("name", "before", "after", "noticed"),
    [
        ("flat_field", "image + i", "image + i + K * H * W", "Invalid read"),
        ("shadow_linear", "out + i, count", "out, count", "race"),
    ],
)
def test_the_simulator_notices_an_access_out_of_bounds_and_a_race(
    simulate: Simulate, name: str, before: str, after: str, noticed: str
) -> None:
    assert noticed in simulate(name, before, after)
