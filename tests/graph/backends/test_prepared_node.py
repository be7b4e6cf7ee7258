"""A launch function is asked anew only where it might do something else."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tactograph.graph.backends.launch import Launch
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.backends.parity_cases import cases, make_inputs
from tactograph.nodes.height.height_system import height_system
from tactograph.nodes.height.rest_at_border import rest_at_border

SIZES = {"H": 24, "W": 32}
SETTINGS = {"width_px": 2}
HEIGHT = np.random.default_rng(3).normal(size=(24, 32)).astype(np.float32)


class Counted:
    """A launch function and how often it was asked."""

    def __init__(self, launch: Callable[[Launch], None]) -> None:
        self.launch, self.times = launch, 0

    def __call__(self, run: Launch) -> None:
        self.times += 1
        self.launch(run)


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counted:
    launch = rest_at_border.kernels.launch
    assert launch is not None
    found = Counted(launch)
    kernels = replace(rest_at_border.kernels, launch=found)
    monkeypatch.setitem(rest_at_border.implementations, "opencl", kernels)
    return found


def test_a_launch_with_the_same_buffers_is_enqueued_again(device: OpenCL, counted: Counted) -> None:
    prepared = device.prepare(rest_at_border, SETTINGS, SIZES)
    height = device.upload(HEIGHT)
    found = [device.download(prepared.launch({"height": height})[0]["rest_at_border"])]
    for _ in range(5):
        found.append(device.download(prepared.launch({"height": height})[0]["rest_at_border"]))
    assert counted.times == 2, "the second is taken down"
    assert all(np.array_equal(each, found[0]) for each in found)


def test_other_buffers_are_taken_in_turns(device: OpenCL, counted: Counted) -> None:
    """Buffers that alternate, as those of recalled values do."""
    prepared = device.prepare(rest_at_border, SETTINGS, SIZES)
    heights = [device.upload(HEIGHT + n) for n in range(2)]
    for _ in range(5):
        for height in heights:
            made = prepared.launch({"height": height})[0]["rest_at_border"]
            np.testing.assert_allclose(device.download(made), rest_at_border(HEIGHT), atol=1e-6)
    assert counted.times == 4


def test_another_array_in_one_buffer_is_another_launch(device: OpenCL, counted: Counted) -> None:
    """Buffers are lent to arrays that need a few bytes less, too."""
    prepared = device.prepare(rest_at_border, SETTINGS, SIZES)
    height = device.upload(HEIGHT)
    for _ in range(3):
        prepared.launch({"height": height})
        prepared.launch({"height": height._replace(shape=(24, 31))})
    assert counted.times == 4


def test_buffers_without_end_are_not_kept(device: OpenCL, counted: Counted) -> None:
    prepared = device.prepare(rest_at_border, SETTINGS, SIZES)
    for _ in range(12):
        prepared.launch({"height": device.constant(HEIGHT)})
    assert counted.times == 12
    assert len(prepared._records) <= 5


@pytest.mark.parametrize(
    ("also", "times"),
    [
        pytest.param(lambda run: run.download(run.inputs["height"]), 5, id="download"),
        pytest.param(
            lambda run: run.begin_download(run.inputs["height"])(), 5, id="begin_download"
        ),
        pytest.param(lambda run: run.put(np.zeros(3, np.float32)), 5, id="put"),
        pytest.param(lambda run: run.queue, 5, id="queue"),
        pytest.param(lambda run: run.capture(lambda: None), 5, id="capture"),
        pytest.param(
            lambda run: run.library(lambda array: None, run.inputs["height"], last=True),
            2,
            id="but not a library",
        ),
        pytest.param(
            lambda run: run.keep(__name__, lambda: run.put(np.zeros(3, np.float32))),
            2,
            id="but not what is made once",
        ),
    ],
)
def test_what_may_do_something_else_is_asked_every_time(
    device: OpenCL, counted: Counted, also: Callable[[Launch], Any], times: int
) -> None:
    launch = counted.launch
    counted.launch = lambda run: (also(run), launch(run))[1]
    prepared = device.prepare(rest_at_border, SETTINGS, SIZES)
    height = device.upload(HEIGHT)
    for _ in range(5):
        prepared.launch({"height": height})
    assert counted.times == times


def test_an_output_is_as_large_as_the_data_tell_of_both_its_sides(device: OpenCL) -> None:
    case = cases(height_system, shapes=((64, 64),))[0]
    inputs = {**make_inputs(height_system, case), "rest": np.ones((64, 64), np.uint8)}
    inputs["rest"][20:30, 30:35] = 0
    there = {n: device.upload(v) if hasattr(v, "shape") else v for n, v in inputs.items()}
    sizes = {symbol: case.sizes[symbol] for symbol in "HWC"}
    made, _ = device.prepare(height_system, case.settings, sizes).launch(there)
    expected = height_system(*height_system.in_order(inputs), **case.settings)
    assert {name: array.shape for name, array in made.items()} == {
        name: array.shape for name, array in expected._asdict().items()
    }
    assert made["right"].shape == (10 + 16, 5 + 16)
