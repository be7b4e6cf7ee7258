"""Nodes that run only where a condition holds, and the nodes that need them."""

from typing import Any

import pytest

from tactograph.graph import Cache, GraphError
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.graph.run.pipeline import Pipeline
from tests.graph.conftest import Command, graph_of

pytestmark = pytest.mark.usefixtures("toys")

# Of the items 1, 2 and 3 the first is not bright.
TOUCHED = """
format: 1
params:
  count: {kind: integer, default: 3}
prefer: [opencl, numpy]
nodes:
  frames: {op: touches, with: {count: $count}}
  cal:    {op: at_rest}
  found:  {op: bright, in: {image: frames.image}}
  light:
    op: flat_field
    in: {image: frames.image, flat: cal.flat, dark: cal.dark, when: found.pixel}
  more:   {op: doubled, in: {image: light}}
  sum:    {op: summed, in: {image: frames.image, before: more}}
  save:   {op: noted, in: {image: more}}
  always: {op: kept, in: {image: sum}}
  joined: {op: join_metrics, in: {one: score, when: found.pixel}}
  score:  {op: watched, in: {image: frames.image}}
outputs: {light: light, more: more, sum: sum, score: joined}
"""


def opened(text: str, backend: str = "numpy", cache: Cache | None = None) -> Pipeline:
    return open_pipeline(graph_of(text), {}, backend=backend, cache=cache)


def means(results: list[Any], name: str) -> list[float | None]:
    return [None if item[name] is None else float(item[name].mean()) for item in results]


@pytest.mark.parametrize("cached", [False, True])
def test_a_node_and_what_needs_it_run_only_where_the_condition_holds(
    toys: list[str], backend: str, cached: bool
) -> None:
    pipeline = opened(TOUCHED, backend, Cache() if cached else None)
    for _ in range(2):
        toys.clear()
        results = list(pipeline.items())
        assert means(results, "light") == [None, 2, 3]
        assert means(results, "more") == [None, 4, 6]
        assert means(results, "sum") == [1, 6, 9], "an input that may be left out is absent"
        assert [call for call in toys if call.startswith(("noted", "kept"))] == [
            "kept 1", "noted 4", "kept 6", "noted 6", "kept 9",
        ]  # fmt: skip
        assert results[0]["score"] is None
        assert results[1]["score"]["mean"] == 2, "of any number of inputs it is none"
        assert results[0].times["more"] == 0
        moved = [s.name for s in pipeline.plan.steps if s.is_transfer and "more" in s.name]
        assert len(moved) == (backend == "opencl")
        assert cached or all(results[0].times[name] == 0 for name in moved), "nothing is moved"


def test_kept_values_follow_the_condition(toys: list[str]) -> None:
    pipeline = opened(TOUCHED.replace("default: 3", "default: 1"), cache=Cache())
    (first,) = pipeline.items()
    assert first["light"] is None
    pipeline.set("found", above=0.5)
    assert float(pipeline.again()["more"].mean()) == 2
    pipeline.set("found", above=1.5)
    assert pipeline.again()["more"] is None
    assert toys.count("doubled") == 1


def test_a_condition_of_a_group_is_one_of_all_its_nodes() -> None:
    text = TOUCHED.replace(", when: found.pixel", "").replace(
        "  more:   {op: doubled, in: {image: light}}",
        "  twice:  {group: double, in: {image: light, when: found.pixel}}",
    )
    text = text.replace(": more}", ": twice}").replace("more: more", "more: twice.more")
    group = """groups:
  double:
    inputs: {image: }
    nodes:
      rest: {op: at_rest}
      more: {op: doubled, in: {image: image}}
    outputs: {more: more}
nodes:"""
    results = list(opened(text.replace("nodes:", group, 1)).items())
    assert means(results, "light") == [1, 2, 3]
    assert means(results, "more") == [None, 4, 6]
    group = group.replace("{image: image}}", "{image: image, when: image}}")
    with pytest.raises(GraphError, match="'twice', around it, has a condition already"):
        graph_of(text.replace("nodes:", group, 1))


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        ("frames.image", "an array of integers; frames.image is float32 K x H x W"),
        ("previous.found.pixel", "a condition cannot be a previous value"),
        ("nothing", "nothing"),
    ],
)
def test_a_wrong_condition_is_refused(condition: str, message: str) -> None:
    with pytest.raises(GraphError, match=message):
        opened(TOUCHED.replace("when: found.pixel", f"when: {condition}"))


def test_explain_and_draw_show_it(about: Command) -> None:
    told = about("explain", TOUCHED, "--backend", "numpy").out
    assert told.count("if found.pixel") == 4, "two nodes, one that needs them, and its sink"
    drawn = about("draw", TOUCHED, "--backend", "numpy").out
    assert "<title>pixel</title>" in drawn


# Of the items 1, 2 and 3 the first is dark after one turn.
TURNS = """
format: 1
prefer: [opencl, numpy]
groups:
  more:
    inputs: {light: {}, frame: {default: frames.image}}
    nodes:
      sum:   {op: summed, in: {image: frame, before: light}}
      twice: {op: doubled, in: {image: sum}}
      still: {op: bright, in: {image: sum}, with: {above: 3.0}}
    outputs: {light: sum}
nodes:
  frames: {op: touches}
  up: {group: more, in: {light: frames.image}, repeat: 3, carry: {light: light}, while: still.pixel}
outputs: {light: up.light, twice: up.twice, pixel: up.still.pixel}
"""


@pytest.mark.parametrize("cached", [False, True])
def test_turns_end_once_their_condition_fails_and_keep_the_last_values(
    toys: list[str], backend: str, cached: bool
) -> None:
    pipeline = opened(TURNS, backend, Cache() if cached else None)
    results = list(pipeline.items())
    assert means(results, "light") == [2, 8, 12]
    assert means(results, "twice") == [4, 16, 24]
    assert [item["pixel"].size > 0 for item in results] == [False, True, True]
    assert toys.count("doubled") == 1 + 3 + 3
    times = results[0].times
    assert times["up.2.sum"] == times["up.3.sum"] == times["up.3.twice"] == 0


def test_turns_are_absent_where_their_inputs_are() -> None:
    seen = """
  found: {op: bright, in: {image: frames.image}}
  seen:  {op: doubled, in: {image: frames.image, when: found.pixel}}
  up:"""
    text = TURNS.replace("default: frames.image", "default: seen").replace("\n  up:", seen)
    assert means(list(opened(text).items()), "light") == [None, 14, 21]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("while: still.pixel", "while: stil.pixel", "has no output or node 'stil'; did you mean"),
        (", repeat: 3, carry: {light: light}", "", "nodes.up.while: 'while' needs 'repeat'"),
        ("in: {image: sum}, with", "in: {image: sum, else: twice}, with", "'else' needs 'when'"),
        ("outputs: {light: up",
         "  last: {op: doubled, in: {image: up, when: up.still.pixel, else: up.3.still}}\n"
         "outputs: {light: up", "'up.3.still' has other outputs than 'last'"),
    ],
)  # fmt: skip
def test_a_wrong_end_of_turns_is_refused(old: str, new: str, message: str) -> None:
    with pytest.raises(GraphError, match=message):
        opened(TURNS.replace(old, new))
