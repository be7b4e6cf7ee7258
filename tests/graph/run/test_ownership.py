"""Memory has an owner: nobody can change what the engine, a node or the caller still reads."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tactograph.graph import NodeError, load
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.graph.run.pipeline import Pipeline
from tests.graph.conftest import STREAM, WAITING, added, graph_of, lit_by

pytestmark = pytest.mark.usefixtures("toys")

SUM = "  sum: {op: summed, in: {image: light, before: previous.%s}}"
SUMMED = added(SUM % "sum", "sum: sum, flat: cal.flat", WAITING)


def opened(text: str, backend: str = "numpy") -> Pipeline:
    return open_pipeline(graph_of(text), {}, backend=backend)


def level(value: float) -> NDArray[np.float32]:
    return np.full((3, 4, 5), value, np.float32)


@pytest.mark.parametrize("output", ["light", "sum", "flat"])
def test_the_arrays_of_a_result_are_read_only(backend: str, output: str) -> None:
    result = load(graph_of(SUMMED), backend=backend)(frames=level(1))
    with pytest.raises(ValueError, match="read-only"):
        result[output][...] = 100


def test_a_neutral_constant_is_read_only(height_file: str) -> None:
    text = f"""
format: 1
nodes:
  height: {{op: read_height, with: {{file: {height_file}}}}}
  rest: {{op: rest_at_border, neutral: true, in: {{height: height}}}}
outputs: {{rest: rest}}
"""
    (result,) = opened(text).items()
    assert not result["rest"].flags.writeable


def test_a_buffer_that_the_caller_refills_changes_neither_memory_nor_result(backend: str) -> None:
    nodes = SUM % "frames.image" + "\n  same: {op: passed_on, in: {image: frames.image}}"
    text = added(nodes, "sum: sum, same: same", WAITING)
    with load(graph_of(text), backend=backend) as pipeline:
        buffer = level(1)
        first = pipeline(frames=buffer)
        buffer[...] = 10
        second = pipeline(frames=buffer)
    assert first["same"].max() == 1
    assert not first["same"].flags.writeable
    assert second["sum"].max() == 11
    buffer[...] = 0  # and it is still the caller's own to write to


@pytest.mark.parametrize("make", [np.asarray, np.ndarray.tolist, memoryview])
def test_results_do_not_share_memory_with_the_callers_arrays(make: Any) -> None:
    buffer = level(1)
    result = load(graph_of(lit_by("passed_on", WAITING)), backend="numpy")(frames=make(buffer))
    buffer[...] = 2
    assert result["light"].max() == 1


def test_a_node_that_writes_into_its_input_is_named() -> None:
    text = (
        WAITING.replace("op: noted", "op: scribbling")
        .replace("score: score}", "score: score, save: save}")
        .replace("{image: light}", "{image: frames.image}")
    )
    stack = level(1)
    with pytest.raises(NodeError, match=r"'save' \(scribbling\).*read-only"):
        load(graph_of(text), backend="numpy")(frames=stack)
    assert stack.max() == 1


def test_figures_that_one_reader_changes_are_whole_for_the_others() -> None:
    nodes = """  changed: {op: scribbled, in: {figures: score}}
  last: {op: remembered, in: {figures: score, before: previous.score}}"""
    found = []
    for result in opened(added(nodes, "changed: changed, last: last")).items():
        found.append((result["last"]["before"], result["last"]["now"], result["score"]["mean"]))
        result["score"]["mean"] = 100.0
    assert found == [(-1, 1, 1), (1, 2, 2), (2, 3, 3)]


def test_a_source_may_refill_its_own_buffer() -> None:
    text = STREAM.replace("op: touches", "op: refilled_touches")
    text = added(SUM % "frames.image", "sum: sum", text)
    results = [float(result["sum"].mean()) for result in opened(text).items()]
    assert results == [1, 3, 5]
