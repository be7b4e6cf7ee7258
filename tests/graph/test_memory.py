"""Streams have a memory: values of the previous item, and objects that a node keeps open."""

from typing import Any

import numpy as np
import pytest

from tactograph.graph import GraphError, Session, load
from tactograph.graph.files.read_graph import Source
from tactograph.graph.plan.sketch import sketch_of
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.graph.run.pipeline import Pipeline
from tactograph.graph.show.draw_svg import to_svg
from tactograph.graph.show.sketch import fold
from tests.graph.conftest import STREAM, Command, Write, added, graph_of, lit_by

pytestmark = pytest.mark.usefixtures("toys")

SUMMED = added("  sum:    {op: summed, in: {image: light, before: previous.sum}}", "sum: sum")
DOUBLED = """
format: 1
extends: base.yaml
patch:
  - {insert: twice, op: doubled, in: {image: light}, after: light}
"""


def opened(graph: Source, backend: str | None = "numpy", /, **params: Any) -> Pipeline:
    return open_pipeline(graph, params, backend=backend)


def test_a_previous_value_is_that_of_the_item_before(backend: str) -> None:
    results = list(opened(graph_of(SUMMED), backend).items())
    assert [float(result["sum"].mean()) for result in results] == [1, 3, 6]


@pytest.mark.parametrize(("light", "total"), [("numpy", "opencl"), ("opencl", "numpy")])
def test_a_previous_value_crosses_between_back_ends(light: str, total: str) -> None:
    text = SUMMED.replace("dark: cal.dark}", "dark: cal.dark}, backend: " + light).replace(
        "before: previous.sum}", "before: previous.light}, backend: " + total
    )
    results = list(opened(graph_of(text), None).items())
    assert [float(result["sum"].mean()) for result in results] == [1, 3, 5]


def test_a_stream_begins_without_memory(backend: str) -> None:
    pipeline = opened(graph_of(SUMMED), backend)
    first = [float(result["sum"].mean()) for result in pipeline.items()]
    assert [float(result["sum"].mean()) for result in pipeline.items()] == first


def test_arrays_passed_in_form_one_stream_until_the_pipeline_forgets() -> None:
    text = SUMMED.replace(", default: 3}", "}")
    stack = np.ones((3, 4, 5), np.float32)
    with load(graph_of(text), backend="numpy") as pipeline:
        assert pipeline(frames=stack)["sum"].max() == 1
        assert pipeline(frames=stack)["sum"].max() == 2
        pipeline.forget()
        assert pipeline(frames=stack)["sum"].max() == 1


def test_images_of_another_size_clear_the_memory_with_a_warning(backend: str) -> None:
    text = SUMMED.replace("touches, with: {count: $count}", "shrinking_touches")
    text = lit_by("doubled", text)
    results = list(opened(graph_of(text), backend).items())
    assert [float(result["sum"].mean()) for result in results] == [2, 4, 2]
    assert ["the image size changed" in " ".join(r.warnings) for r in results] == [
        False,
        False,
        True,
    ]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("image: light, before: previous.sum", "image: previous.light", "first item has no prev"),
        ("previous.sum", "previous.summ", "did you mean 'sum'"),
        ("previous.sum}", "previous.cal.flat}", "the same for all items"),
        ("image: light, before: previous.sum", "image: cal.flat, before: previous.light", "once"),
        ("previous.sum", "previous.score", "is not an array"),
        ("sum:    {op: summed", "previous: {op: summed", "no node can be called 'previous'"),
        ("truth: frames.truth", "elevation: frames.truth", r"it takes: image, truth"),
    ],
)
def test_a_wrong_previous_value_or_input_is_refused(old: str, new: str, message: str) -> None:
    with pytest.raises(GraphError, match=message):
        opened(graph_of(SUMMED.replace(old, new)))


def test_a_node_that_only_its_successor_recalls_is_run() -> None:
    text = STREAM.replace("op: watched,", "op: counted,").replace(
        "in: {image: light, truth: frames.truth}", "in: {image: light, before: previous.score}"
    )
    assert [result["score"] for result in opened(graph_of(text)).items()] == [1, 2, 3]


def test_a_memory_is_drawn_as_a_dashed_edge() -> None:
    sketch = fold(sketch_of(opened(graph_of(SUMMED)).plan))
    assert "<title>previous summed</title>" in to_svg(sketch)


def test_an_object_that_a_node_keeps_is_opened_once_and_closed_with_the_stream(
    toys: list[str],
) -> None:
    graph = graph_of(STREAM.replace("op: noted", "op: holds_open"))
    list(opened(graph).items())
    diary = [line for line in toys if "diary" in line or "holds_open" in line]
    assert diary == ["diary opened", "holds_open 1", "holds_open 2", "holds_open 3", "diary closed"]
    with opened(graph) as pipeline:
        next(pipeline.items())
    assert toys[-2:] == ["holds_open 1", "diary closed"], "also if the stream is closed early"


def test_a_session_keeps_one_object_until_it_is_closed() -> None:
    session = Session()
    first = session.keep(list)
    assert session.keep(list) is first
    session.close()
    assert session.keep(list) is not first


def test_a_warning_belongs_to_its_item() -> None:
    text = added("  copy: {op: warns_once, in: {image: light}}", "copy: copy")
    assert [result.warnings for result in opened(graph_of(text)).items()] == [[], ["two"], []]


def test_ctrl_c_ends_an_endless_stream_without_an_error(
    toys: list[str], write: Write, tactograph: Command
) -> None:
    text = STREAM.replace("touches, with: {count: $count}", "endless_touches")
    outcome = tactograph("run", write(text.replace("op: noted", "op: holds_open")))
    assert (outcome.code, outcome.err) == (0, "stopped\n")
    assert toys[-2:] == ["camera closed", "diary closed"]


def test_an_inserted_node_is_read_by_readers_that_name_the_output_too(write: Write) -> None:
    base = STREAM.replace("image: light, truth", "image: light.flat_field, truth")
    write(base, "base.yaml")
    results = opened(write(DOUBLED, "variant.yaml")).items()
    assert [result["score"]["mean"] for result in results] == [2, 4, 6]


def test_a_sink_may_end_the_stream_and_all_sinks_take_its_last_item(
    toys: list[str], write: Write, tactograph: Command
) -> None:
    enough = STREAM.replace("  save:", "  enough: {op: enough, in: {image: frames.image}}\n  save:")
    text = enough.replace("touches, with: {count: $count}", "endless_touches, with: {stop_at: 9}")
    outcome = tactograph("run", write(text), "--backend", "numpy")
    assert (outcome.code, outcome.err) == (0, "")
    assert [call for call in toys if call.startswith("enough")] == ["enough 1", "enough 2"]
    assert toys[-1] == "camera closed"
    assert sum(call.startswith("noted") for call in toys) == 2
    pipeline = opened(graph_of(enough))
    assert [len(list(pipeline.items())) for _ in range(2)] == [2, 2], "it can run again"


def test_an_inserted_node_is_recalled_by_readers_that_recalled_its_input(write: Write) -> None:
    write(SUMMED.replace("before: previous.sum", "before: previous.light"), "base.yaml")
    results = opened(write(DOUBLED, "variant.yaml")).items()
    assert [float(result["sum"].mean()) for result in results] == [2, 6, 10]
