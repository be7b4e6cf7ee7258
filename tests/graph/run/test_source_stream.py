"""The next item is read while the last one is in use; only the time differs."""

import threading
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from tactograph.graph import InputError, load
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.run.open_pipeline import open_pipeline
from tests.graph.conftest import STREAM, WAITING, added, graph_of

pytestmark = pytest.mark.usefixtures("toys")

SUMMED = added("  sum: {op: summed, in: {image: light, before: previous.sum}}", "sum: sum", WAITING)
LONG_S = 30.0


def refilled(count: int) -> Iterator[NDArray[np.float32]]:
    """Stacks full of 1, 2, ..., all in the same memory."""
    buffer = np.empty((3, 4, 5), np.float32)
    for number in range(1, count + 1):
        buffer[...] = number
        yield buffer


def test_a_stream_gives_what_calls_give(backend: str) -> None:
    with load(graph_of(SUMMED), backend=backend) as pipeline:
        called = [pipeline(frames=stack)["sum"] for stack in refilled(20)]
        pipeline.forget()
        streamed = [result["sum"] for result in pipeline.stream(refilled(20))]
    np.testing.assert_array_equal(streamed, called)
    assert streamed[-1].max() == sum(range(1, 21))


def test_one_item_is_read_while_the_last_is_in_use_and_no_more() -> None:
    pipeline, begun = (
        load(graph_of(WAITING), backend="numpy"),
        [threading.Event() for _ in range(5)],
    )

    def items() -> Iterator[NDArray[np.float32]]:
        for event, stack in zip(begun, refilled(5), strict=True):
            event.set()
            yield stack

    for number, _ in enumerate(pipeline.stream(items())):
        assert all(event.wait(LONG_S) for event in begun[: number + 2])
        assert not any(event.is_set() for event in begun[number + 2 :])


def test_an_error_of_the_iterable_is_raised_at_its_item() -> None:
    pipeline, means = load(graph_of(WAITING), backend="numpy"), []

    def items() -> Iterator[NDArray[np.float32]]:
        yield from refilled(2)
        yield np.ones((4, 5), np.float32)

    with pytest.raises(InputError, match="K x H x W, not one image"):
        means += (result["light"].mean() for result in pipeline.stream(items()))
    assert pipeline(frames=next(refilled(1)))["light"].mean() == 1

    def unplugged() -> Iterator[NDArray[np.float32]]:
        yield from refilled(1)
        raise ConnectionError("unplugged")

    stream = pipeline.stream(unplugged())
    assert next(stream)["light"].mean() == 1
    with pytest.raises(ConnectionError, match="unplugged"):
        next(stream)


def test_a_stream_that_is_left_waits_for_no_item() -> None:
    pipeline, gate = load(graph_of(WAITING), backend="numpy"), threading.Event()

    def items() -> Iterator[NDArray[np.float32]]:
        yield from refilled(1)
        gate.wait()
        yield from refilled(1)

    stream = pipeline.stream(items())
    assert next(stream)["light"].mean() == 1
    stream.close()
    assert not gate.is_set()
    gate.set()


@pytest.mark.parametrize("ahead", [False, True])
def test_reading_ahead_changes_no_result(monkeypatch: pytest.MonkeyPatch, *, ahead: bool) -> None:
    monkeypatch.setattr(find_node("cut_touches"), "ahead", ahead)
    text = added("  sum: {op: summed, in: {image: light, before: previous.sum}}", "sum: sum")
    text = text.replace("op: touches", "op: cut_touches")
    with open_pipeline(graph_of(text), {"count": 3}, backend="numpy") as pipeline:
        # Another test's thread may not have ended yet.
        results, others, threads = [], set(threading.enumerate()), set[str]()
        for result in pipeline.items():
            results.append(result)
            threads |= {thread.name for thread in threading.enumerate() if thread not in others}
        assert pipeline.closing_warnings == ["cut short"]
    assert [float(result["sum"].mean()) for result in results] == [1, 3, 6]
    assert [result.warnings for result in results] == [[], [], []]
    assert ("read" in threads) == ahead


def test_a_source_that_is_left_before_its_end_is_closed(
    toys: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(find_node("touches"), "ahead", True)
    pipeline = open_pipeline(graph_of(STREAM), {"count": 9}, backend="numpy")
    stream = pipeline.items()
    next(stream)
    stream.close()
    assert "touch 3" not in toys
    assert "read" not in [thread.name for thread in threading.enumerate()]
