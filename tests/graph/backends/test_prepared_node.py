"""A launch function is called anew only where it might enqueue something else."""

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
    """A launch function and how often it was called."""

    def __init__(self, launch: Callable[[Launch], None]) -> None:
        self.launch, self.times = launch, 0

    def __call__(self, run: Launch) -> None:
        self.times += 1
        self.launch(run)


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counted:
    launch = rest_at_border.kernels.launch
    assert launch is not None
    counter = Counted(launch)
    kernels = replace(rest_at_border.kernels, launch=counter)
    monkeypatch.setattr(rest_at_border, "opencl_kernels", kernels)
    return counter


def test_a_launch_with_the_same_buffers_is_enqueued_from_its_record(
    device: OpenCL, counted: Counted
) -> None:
    prepared = device.prepare(rest_at_border, SETTINGS, SIZES)
    height = device.upload(HEIGHT)
    results = [device.download(prepared.launch({"height": height})[0]["rest_at_border"])]
    for _ in range(5):
        results.append(device.download(prepared.launch({"height": height})[0]["rest_at_border"]))
    assert counted.times == 2, "the second call is recorded"
    assert all(np.array_equal(each, results[0]) for each in results)


def test_buffers_that_alternate_have_a_record_each(device: OpenCL, counted: Counted) -> None:
    """The buffers of recalled values alternate."""
    prepared = device.prepare(rest_at_border, SETTINGS, SIZES)
    heights = [device.upload(HEIGHT + n) for n in range(2)]
    for _ in range(5):
        for height in heights:
            result = prepared.launch({"height": height})[0]["rest_at_border"]
            np.testing.assert_allclose(device.download(result), rest_at_border(HEIGHT), atol=1e-6)
    assert counted.times == 4


def test_another_array_in_one_buffer_is_another_launch(device: OpenCL, counted: Counted) -> None:
    """The pool also lends a buffer to an array that needs a few bytes less."""
    prepared = device.prepare(rest_at_border, SETTINGS, SIZES)
    height = device.upload(HEIGHT)
    for _ in range(3):
        prepared.launch({"height": height})
        prepared.launch({"height": height._replace(shape=(24, 31))})
    assert counted.times == 4


def test_the_number_of_records_of_ever_new_buffers_is_limited(
    device: OpenCL, counted: Counted
) -> None:
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
            id="but not a value that is made once",
        ),
    ],
)
def test_a_launch_function_is_called_every_time_unless_its_launches_can_be_recorded(
    device: OpenCL, counted: Counted, also: Callable[[Launch], Any], times: int
) -> None:
    launch = counted.launch
    counted.launch = lambda run: (also(run), launch(run))[1]
    prepared = device.prepare(rest_at_border, SETTINGS, SIZES)
    height = device.upload(HEIGHT)
    for _ in range(5):
        prepared.launch({"height": height})
    assert counted.times == times


def test_the_data_may_decide_both_sides_of_an_output(device: OpenCL) -> None:
    case = cases(height_system, shapes=((64, 64),))[0]
    inputs = {**make_inputs(height_system, case), "rest": np.ones((64, 64), np.uint8)}
    inputs["rest"][20:30, 30:35] = 0
    uploaded = {n: device.upload(v) if hasattr(v, "shape") else v for n, v in inputs.items()}
    sizes = {symbol: case.sizes[symbol] for symbol in "HWC"}
    outputs, _ = device.prepare(height_system, case.settings, sizes).launch(uploaded)
    expected = height_system(*height_system.in_order(inputs), **case.settings)
    assert {name: array.shape for name, array in outputs.items()} == {
        name: array.shape for name, array in expected._asdict().items()
    }
    assert outputs["right"].shape == (10 + 16, 5 + 16)
