"""Arrays that stay on the device: passed in and out there, and never changed by others."""

from typing import Any

import numpy as np
import pyopencl as cl
import pytest
from numpy.typing import NDArray
from pyopencl.array import Array, to_device

from tactograph.graph import Cache, InputError, load
from tactograph.graph.backends.device_queue import Queue
from tactograph.graph.run.pipeline import Pipeline
from tests.fixtures import Calibration, Raytraced
from tests.graph.conftest import SLOPES, WAITING, added, graph_of

pytestmark = pytest.mark.usefixtures("toys")

SUM = "  sum: {op: add_light, in: {light: frames.image, more: previous.frames.image}}"
SUMMED = added(SUM, "sum: sum, same: frames.image, flat: cal.flat", WAITING)


def level(value: float) -> NDArray[np.float32]:
    return np.full((3, 4, 5), value, np.float32)


def opened(text: str, **options: Any) -> Pipeline:
    return load(graph_of(text), backend="opencl", to="device", **options)


def test_sensor_and_height_are_chained_without_a_transfer(
    raytraced: Raytraced, calibration: Calibration, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The numbers are those of arrays on the host."""
    truth = np.load(raytraced / "near33" / "cat_film" / "truth_height_mm.npy")
    params: dict[str, Any] = {"calibration": calibration("near33"), "backend": "opencl"}

    def chain(**options: Any) -> tuple[Pipeline, Pipeline]:
        see = load("see_touch", outputs=["image"], seed=None, **params, **options)
        return see, load("reconstruct", outputs=["height"], **params, **options)

    see, back = chain()
    expected = [back(frames=see(height=z)["image"])["height"] for z in (truth, truth / 2)]
    see, back = chain(to="device")
    z, half = to_device(see.queue, truth), to_device(see.queue, truth / 2)
    first = back(frames=see(height=z)["image"])["height"]  # also runs the nodes outside the stream

    def refuse(*_: object) -> None:
        raise AssertionError("a transfer")

    for transfer in ("send", "start_upload", "start_download", "download"):
        monkeypatch.setattr(Queue, transfer, refuse)
    second = back(frames=see(height=half)["image"])["height"]
    moves = [s for p in (see, back) for s in p.plan.steps if s.stream and s.kind == "download"]
    assert all(step.conditions for step in moves), "only a film with interreflection asks the host"
    monkeypatch.undo()
    np.testing.assert_array_equal(first.get(), expected[0])
    np.testing.assert_array_equal(second.get(), expected[1])


@pytest.mark.parametrize("cache", [None, Cache()], ids=["", "cached"])
def test_an_array_on_the_device_belongs_to_the_caller_alone(cache: Cache | None) -> None:
    """Passed in or returned, either side may change it without an effect on the other."""
    pipeline = opened(SUMMED, cache=cache)
    buffer = to_device(pipeline.queue, level(0.25))
    first = pipeline(frames=buffer)
    buffer.set(level(0.5))
    second = pipeline(frames=buffer)
    view = second["sum"][1]
    for result in (first, second):
        for name in ("same", "flat"):
            result[name].set(level(9))
    del result, second
    third = pipeline(frames=level(0.125))
    assert first["sum"].get().max() == 0.25
    assert view.get().min() == view.get().max() == 0.75
    assert third["sum"].get().max() == 0.625
    assert third["flat"].get().max() < 9


def test_memory_returns_to_the_pool_with_its_last_view() -> None:
    pipeline = opened(SUMMED)
    for _ in range(3):
        view = pipeline(frames=level(1))["light"][2]
    count = pipeline.buffers
    for _ in range(3):
        view = pipeline(frames=level(1))["light"][2]
    assert pipeline.buffers == count
    assert view.get().max() == 1


def test_a_slice_of_an_array_is_read_where_it_begins(height_file: str) -> None:
    height = np.load(height_file)
    pipeline = opened(SLOPES)
    both = to_device(pipeline.queue, np.stack([0 * height, height]))
    expected = load(graph_of(SLOPES), backend="opencl")(height=height)["height"]
    for array in (both[1], height.astype(float), to_device(pipeline.queue, height.astype(float))):
        np.testing.assert_array_equal(pipeline(height=array)["height"].get(), expected)


def test_on_a_cpu_the_host_maps_a_result_without_a_copy(height_file: str) -> None:
    result = opened(SLOPES)(height=np.load(height_file))
    first, second = (np.from_dlpack(result["height"].map_to_host()) for _ in range(2))
    assert np.shares_memory(first, second)
    assert repr(result).startswith("Result(height: float32 24 x 32,")
    assert result._repr_html_().count("<img") == 1


def test_an_array_that_the_device_cannot_read_is_refused(height_file: str) -> None:
    height = np.load(height_file)
    pipeline = opened(SLOPES)
    elsewhere = cl.CommandQueue(cl.Context([pipeline.queue.device]))
    bad = height.copy()
    bad[3, 4] = np.nan
    cases: list[tuple[Pipeline, Array, str]] = [
        (pipeline, to_device(elsewhere, height), "make it with pipeline.queue"),
        (pipeline, to_device(pipeline.queue, height)[:, ::2], "height is not contiguous"),
        (pipeline, to_device(pipeline.queue, bad), "holds NaN"),
        (load(graph_of(SLOPES), backend="numpy"), to_device(elsewhere, height), r"height\.get\(\)"),
    ]
    for opened_graph, array, message in cases:
        with pytest.raises(InputError, match=message):
            opened_graph(height=array)
    with pytest.raises(InputError, match="none of its nodes runs on a device"):
        load(graph_of(SLOPES), backend="numpy", to="device")
    with pytest.raises(InputError, match="to='gpu': 'host' or 'device'"):
        load(graph_of(SLOPES), to="gpu")  # type: ignore[call-overload]
