"""A pipeline belongs to one thread, reads one stream at a time, and ends when it is closed."""

import threading

import numpy as np
import pytest

from tactograph.graph import InputError, load
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.graph.run.pipeline import Pipeline
from tests.graph.conftest import STREAM, WAITING, added, graph_of, lit_by
from tests.graph.toys import Gate

pytestmark = pytest.mark.usefixtures("toys")

STACK = np.ones((3, 4, 5), np.float32)


def opened(text: str) -> Pipeline:
    return open_pipeline(graph_of(text), {}, backend="numpy")


def test_a_second_thread_is_refused_while_the_first_is_running() -> None:
    pipeline = load(graph_of(lit_by("gated", WAITING)), backend="numpy")
    results: list[float] = []
    Gate.close()
    thread = threading.Thread(target=lambda: results.append(pipeline(frames=STACK)["light"].max()))
    thread.start()
    Gate.wait_until_reached()
    try:
        for use in (lambda: pipeline(frames=STACK), pipeline.forget, pipeline.close):
            with pytest.raises(InputError, match=r"another thread is using the pipeline; load one"):
                use()
    finally:
        Gate.open()
        thread.join()
    assert results == [1]
    assert pipeline(frames=STACK)["light"].max() == 1


@pytest.mark.parametrize("use", ["call", "items", "aim", "forget"])
def test_a_closed_pipeline_cannot_be_used(use: str) -> None:
    pipeline = opened(STREAM) if use == "items" else load(graph_of(WAITING), backend="numpy")
    pipeline.close()
    pipeline.close()
    uses = {
        "call": lambda: pipeline(frames=STACK),
        "items": lambda: list(pipeline.items()),
        "aim": lambda: pipeline.aim(count=1),
        "forget": pipeline.forget,
    }
    with pytest.raises(InputError, match="the pipeline was closed; load the graph again"):
        uses[use]()


def test_a_pipeline_reads_one_stream_at_a_time() -> None:
    pipeline = opened(STREAM)
    first = pipeline.items()
    next(first)
    with pytest.raises(InputError, match="being iterated over already"):
        next(pipeline.items())
    assert [result["score"]["mean"] for result in first] == [2, 3]
    assert [result["score"]["mean"] for result in pipeline.items()] == [1, 2, 3]


def test_a_pipeline_can_be_used_after_an_item_that_failed() -> None:
    pipeline = load(graph_of(WAITING), backend="numpy")
    with pytest.raises(InputError):
        pipeline(frames=np.ones((3, 9, 9), np.float32))
    assert pipeline(frames=STACK)["light"].max() == 1


def test_a_session_outside_the_stream_is_opened_anew_with_each_stream(toys: list[str]) -> None:
    pipeline = opened(added("  once: {op: opens_once}", "once: once"))
    for _ in range(2):
        list(pipeline.items())
    diary = [line for line in toys if "once" in line or "diary" in line]
    assert diary == ["diary opened", "opens_once", "diary closed"] * 2
