"""A pipeline belongs to one thread, goes through one stream, and ends when it is closed."""

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
    found: list[float] = []
    Gate.close()
    thread = threading.Thread(target=lambda: found.append(pipeline(frames=STACK)["light"].max()))
    thread.start()
    Gate.wait_until_reached()
    try:
        for use in (lambda: pipeline(frames=STACK), pipeline.forget, pipeline.close):
            with pytest.raises(InputError, match=r"another thread is using the pipeline; load one"):
                use()
    finally:
        Gate.open()
        thread.join()
    assert found == [1]
    assert pipeline(frames=STACK)["light"].max() == 1


@pytest.mark.parametrize("use", ["call", "items", "aim", "forget"])
def test_a_closed_pipeline_refuses_every_use(use: str) -> None:
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


def test_a_pipeline_goes_through_one_stream_at_a_time() -> None:
    pipeline = opened(STREAM)
    first = pipeline.items()
    next(first)
    with pytest.raises(InputError, match="being iterated over already"):
        next(pipeline.items())
    assert [result["score"]["mean"] for result in first] == [2, 3]
    assert [result["score"]["mean"] for result in pipeline.items()] == [1, 2, 3]


def test_an_item_that_fails_leaves_the_pipeline_free() -> None:
    pipeline = load(graph_of(WAITING), backend="numpy")
    with pytest.raises(InputError):
        pipeline(frames=np.ones((3, 9, 9), np.float32))
    assert pipeline(frames=STACK)["light"].max() == 1


def test_a_node_that_runs_once_opens_its_session_for_each_stream(toys: list[str]) -> None:
    pipeline = opened(added("  once: {op: opens_once}", "once: once"))
    for _ in range(2):
        list(pipeline.items())
    diary = [line for line in toys if "once" in line or "diary" in line]
    assert diary == ["diary opened", "opens_once", "diary closed"] * 2
