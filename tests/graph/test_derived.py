"""Sizes that follow from other sizes, and outputs that nobody reads."""

from typing import Any

import numpy as np
import pytest

from tactograph.graph import EVERYTHING, InputError, SizeRule, node
from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.declare.node import Node
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.graph.run.result import Result
from tactograph.nodes import Light
from tests.graph.conftest import STREAM, added, graph_of

pytestmark = pytest.mark.usefixtures("toys")


def first(file: str, backend: str) -> Result:
    return next(open_pipeline(file, {}, backend=backend).items())


@pytest.mark.parametrize(("rows", "remaining"), [(1, 4), (2, 2), (3, 2), (5, 1)])
def test_a_derived_size_is_another_divided_by_a_parameter_and_rounded_up(
    backend: str, rows: int, remaining: int
) -> None:
    text = added(f"  thin: {{op: strips, in: {{image: light}}, with: {{rows: {rows}}}}}", "t: thin")
    assert first(graph_of(text), backend)["t"].shape == (3, remaining, 5)


def test_later_nodes_have_the_derived_size(backend: str) -> None:
    nodes = """  thin: {op: strips, in: {image: light}}
  more: {op: summed, in: {image: thin}}
  thinner: {op: strips, in: {image: more}}"""
    result = first(graph_of(added(nodes, "a: more, b: thinner")), backend)
    assert (result["a"].shape, result["b"].shape) == ((3, 2, 5), (3, 1, 5))


def test_a_derived_size_that_clashes_names_the_rule(backend: str) -> None:
    nodes = """  thin: {op: strips, in: {image: light}}
  off: {op: flat_field, in: {image: thin, flat: cal.flat, dark: cal.dark}}"""
    with pytest.raises(InputError, match=r"size h is 2 in thin \(H / rows\) but 4 in cal.flat"):
        first(graph_of(added(nodes, "off: off")), backend)


def test_settings_changed_between_two_items_apply_to_the_next(backend: str) -> None:
    text = added(
        """  dim: {op: flat_field, in: {image: frames.image, flat: cal.flat, dark: cal.dark},
         with: {floor: $floor}}
  thin: {op: strips, in: {image: dim}, with: {rows: $rows}}""",
        "t: thin",
    ).replace("default: 3}", "default: 3}\n  rows: {kind: integer}\n  floor: {kind: number}")
    pipeline = open_pipeline(graph_of(text), {"rows": 2, "floor": 1}, backend=backend)
    with pipeline:
        items = pipeline.items()
        assert next(items)["t"].tolist() == np.full((3, 2, 5), 1.0).tolist()
        pipeline.aim(rows=4, floor=8)
        assert next(items)["t"].tolist() == np.full((3, 1, 5), 0.25).tolist()


AIMED = (
    STREAM.replace("{count: $count}", "{count: $count, rows: $rows}")
    .replace("{op: at_rest}", "{op: at_rest, with: {level: $level}}")
    .replace("default: 3}", "default: 3}\n  rows: {kind: integer}\n  level: {kind: number}")
)


def test_settings_changed_earlier_stay() -> None:
    pipeline = open_pipeline(graph_of(AIMED), {"rows": 4, "level": 1}, backend="numpy")
    pipeline.aim(count=1)
    pipeline.aim(rows=4)
    assert len(list(pipeline.items())) == 1


def test_a_node_whose_settings_stay_is_not_prepared_again(monkeypatch: pytest.MonkeyPatch) -> None:
    prepared: list[str] = []
    prepare = OpenCL.prepare

    def note(device: OpenCL, node: Node, *more: Any) -> Any:
        prepared.append(node.name)
        return prepare(device, node, *more)

    monkeypatch.setattr(OpenCL, "prepare", note)
    pipeline = open_pipeline(graph_of(AIMED), {"rows": 4, "level": 1}, backend="opencl")
    for count in (1, 2, 3):
        pipeline.aim(count=count)
        assert len(list(pipeline.items())) == count
    assert prepared == ["flat_field"]


def test_a_refused_change_of_settings_changes_none() -> None:
    pipeline = open_pipeline(graph_of(AIMED), {"rows": 4, "level": 1}, backend="numpy")
    with pytest.raises(InputError, match="'cal' runs once and takes \\$level"):
        pipeline.aim(count=1, level=2)
    assert len(list(pipeline.items())) == 3


def test_a_rule_that_names_an_unknown_size_is_refused() -> None:
    def thin(image: Light, *, rows: int = 2) -> Light:
        return image

    with pytest.raises(TypeError, match=r"thin: size h = H / rows names no size or no parameter"):
        node(derived={"h": SizeRule("H", by="rows")})(thin)


@pytest.mark.parametrize("read", ["low", "high"])
def test_an_output_that_nobody_reads_is_not_computed(
    toys: list[str], backend: str, read: str
) -> None:
    result = first(
        graph_of(added("  half: {op: halves, in: {image: light}}", f"h: half.{read}")), backend
    )
    assert result["h"].max() == {"low": 0.5, "high": 1.5}[read]
    assert backend == "opencl" or toys.count("low") + toys.count("high") == 1


def test_an_output_that_only_the_next_item_reads_is_computed(backend: str) -> None:
    nodes = """  half: {op: halves, in: {image: light}}
  sum: {op: summed, in: {image: light, before: previous.half.low}}"""
    results = open_pipeline(graph_of(added(nodes, "sum: sum")), {}, backend=backend).items()
    assert [float(result["sum"].mean()) for result in results] == [1, 2.5, 4]


def test_a_plain_call_computes_all_outputs() -> None:
    assert "anything" in EVERYTHING
    image: np.ndarray = np.ones((3, 2, 2), np.float32)
    from tests.graph.toys import halves

    assert [part.mean() for part in halves(image)] == [0.5, 1.5]
