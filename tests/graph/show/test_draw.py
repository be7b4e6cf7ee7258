"""Pictures of a plan: Mermaid and SVG."""

import re
from collections.abc import Callable
from typing import NamedTuple, Self
from xml.etree import ElementTree

import pytest

from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.files.read_graph import read_graph, shipped_names
from tactograph.graph.plan.make_plan import make_plan
from tactograph.graph.plan.plan import Plan
from tactograph.graph.plan.sketch import sketch_of
from tactograph.graph.show.draw_mermaid import to_mermaid
from tactograph.graph.show.draw_svg import to_svg
from tactograph.graph.show.sketch import Edge, Sketch, fold
from tests.each import each
from tests.graph.conftest import SLOPES, Write
from tests.graph.plan.plans import planned


def every_step(plan: Plan) -> Sketch:
    return sketch_of(plan, transfers=True)


def edges(plan: Plan) -> list[Edge]:
    return every_step(plan).edges


def folded(plan: Plan) -> Sketch:
    return fold(sketch_of(plan))


def test_every_step_and_every_edge_is_drawn_once(write: Write, device: OpenCL) -> None:
    plan = planned(write(SLOPES), device)
    mermaid = to_mermaid(every_step(plan))
    assert len(re.findall(r"^  n\d+[\[(]", mermaid, re.MULTILINE)) == len(plan.steps)
    for step in plan.steps:
        assert mermaid.count(f'"{step.name}<br/>') == 1
    assert mermaid.count(" -->|") == len(edges(plan))


def grouped() -> Plan:
    """A use of a group whose own node reads one of a use inside it."""
    noted = {"op": "rest_at_border", "in": {"height": "height"}}
    groups = {
        "one": {"inputs": {"height": {}}, "nodes": {"n": noted}, "outputs": {"height": "n"}},
        "two": {
            "inputs": {"height": {}},
            "nodes": {
                "a": {"group": "one", "in": {"height": "height"}},
                "b": {"op": "rest_at_border", "in": {"height": "a.height"}},
            },
            "outputs": {"height": "b"},
        },
    }
    use = {"group": "two", "in": {"height": "ball"}}
    ball = {"op": "shape_ball", "with": {"width_px": 32, "height_px": 24}}
    graph = {"format": 1, "groups": groups, "outputs": {"height": "use.height"}}
    nodes = {"shape": ball, "ball": {**noted, "in": {"height": "shape.height"}}, "use": use}
    return make_plan(read_graph({**graph, "nodes": nodes}), {}, device=None)


def test_the_nodes_of_a_use_are_drawn_together() -> None:
    plan = grouped()
    mermaid = to_mermaid(every_step(plan))
    assert re.findall(r"subgraph (\S+)|(\bend)$", mermaid, re.MULTILINE) == [
        ('use_use["use"]', ""), ('use_use_a["use.a"]', ""), ("", "end"), ("", "end"),
    ]  # fmt: skip


def test_an_edge_runs_through_its_transfer(write: Write, device: OpenCL) -> None:
    drawn = edges(planned(write(SLOPES), device))
    assert ("height", "upload height.read_height", "read_height") in drawn
    assert ("upload height.read_height", "slope", "read_height") in drawn
    direct = ("height", "slope", "read_height")
    assert direct not in drawn
    assert direct in edges(planned(write(SLOPES), None)), "where nothing is transferred"


def test_the_back_ends_have_colours_of_their_own(write: Write, device: OpenCL) -> None:
    mermaid = to_mermaid(folded(planned(write(SLOPES), device)))
    used = {*re.findall(r":::(\w+)", mermaid)}
    colours = dict(re.findall(r"classDef (\w+) fill:(#\w+)", mermaid))
    assert len({colours[backend] for backend in used}) == 2


@each("name", shipped_names())
def test_every_edge_joins_two_steps(name: str, device: OpenCL) -> None:
    plan = planned(name, device)
    steps = {step.name for step in plan.steps}
    assert all({a, b} <= steps for a, b, _ in edges(plan))


class Box(NamedTuple):
    """A rectangle of an SVG."""

    x: float
    y: float
    width: float
    height: float

    @property
    def right(self) -> float:
        return self.x + self.width

    @property
    def bottom(self) -> float:
        return self.y + self.height

    def meets(self, other: Self) -> bool:
        across = self.x < other.right and other.x < self.right
        return across and self.y < other.bottom and other.y < self.bottom


def test_the_svg_is_well_formed_whatever_the_file_is_called(write: Write) -> None:
    svg = to_svg(every_step(planned(write(SLOPES, "a<b&c.yaml"), None)))
    assert ElementTree.fromstring(svg)[0].text == "a<b&c"


def test_a_use_of_a_group_is_one_box_and_transfers_are_none(device: OpenCL) -> None:
    plan = planned("reconstruct", device)
    boxes = {box.name: box for box in folded(plan).boxes}
    assert boxes["rough"].label == "4 x rough_pass: 31 nodes"
    assert not [name for name in boxes if "." in name]
    assert not [name for name in boxes if name.split()[0] in ("upload", "download")]
    assert boxes.keys() == {name.partition(".")[0] for name in plan.tasks}
    for drawn_as in (
        to_mermaid(folded(plan)),
        to_svg(folded(plan)),
    ):
        assert "4 x rough_pass: 31 nodes" in drawn_as


def test_a_use_that_reads_what_was_made_of_its_own_values_stays_open(device: OpenCL) -> None:
    flat = {"op": "rest_at_border", "in": {"height": "height"}}
    last = {"op": "rest_at_border", "in": {"height": "more"}}
    group = {"inputs": {"height": {}, "more": {}}, "nodes": {"first": flat, "last": last}}
    nodes = {
        "ball": {"op": "shape_ball", "with": {"radius_mm": 5.0}},
        "use": {"group": "two", "in": {"height": "ball.height", "more": "between"}},
        "between": {"op": "rest_at_border", "in": {"height": "use.first"}},
    }
    graph = {"format": 1, "groups": {"two": group}, "nodes": nodes}
    plan = make_plan(read_graph({**graph, "outputs": {"h": "use.last"}}), {}, device=device)
    names = [box.name for box in folded(plan).boxes]
    assert names == ["ball", "use.first", "between", "use.last"]


def test_an_opened_use_shows_the_uses_in_it(device: OpenCL) -> None:
    sketch = sketch_of(planned("reconstruct", device))
    names = {box.name for box in fold(sketch, ["rough", "rough.2"]).boxes}
    assert {"take", "rough.1", "rough.2.label", "rough.4"} <= names
    assert not {"rough", "rough.2", "rough.1.label"} & names


@pytest.mark.parametrize(("sketched", "widest"), [(folded, 1500), (every_step, 4000)])
@pytest.mark.parametrize("name", ["paper", "reconstruct", "precise", "calibrate"])
def test_a_picture_fits_a_page_with_boxes_apart_and_edges_downwards(
    name: str, sketched: Callable[[Plan], Sketch], widest: float, device: OpenCL
) -> None:
    sketch = sketched(planned(name, device))
    svg = to_svg(sketch)
    assert float(re.search(r'width="(\d+)"', svg)[1]) < widest  # type: ignore[index]
    rect = r'<rect x="([\d.]+)" y="([\d.]+)" width="(\d+)" height="(\d+)"'
    boxes = [Box(*map(float, found)) for found in re.findall(r"<g [^>]*>\n" + rect, svg)]
    assert len(boxes) == len(sketch.boxes)
    for number, box in enumerate(boxes):
        assert not any(box.meets(other) for other in boxes[number + 1 :])
    ways = re.findall(r'<path d="M[\d.]+ ([\d.]+)C.*?([\d.]+)" fill="none" stroke="#777"', svg)
    assert ways
    assert all(float(start) < float(end) for start, end in ways)
    assert not re.search(r" ([\d.]+)V\1\"", svg), "a tip points down, as the last line does"
    for how, words in re.findall(r"<text ([^>]*)>([^<]*)<", svg):
        letter_px = 6.8  # of 11 px type, some of it bold
        assert len(words) * letter_px < boxes[0].width or "textLength" in how, words


def test_a_folded_picture_tells_the_time_of_all_nodes_of_a_use(device: OpenCL) -> None:
    plan = planned("reconstruct", device)
    svg = to_svg(folded(plan), {"rough.1.label": 2.0, "rough.2.matt": 1.0, "label": 8.0})
    assert "4 x rough_pass: 31 nodes, 3 ms" in svg
    assert "label_lights, 8 ms" in svg


def test_a_value_of_the_item_before_is_a_dashed_way_back(device: OpenCL) -> None:
    plan = planned("reconstruct_follow_drift", device)
    back = folded(plan).recalls
    assert back
    assert to_svg(folded(plan)).count("stroke-dasharray") == len(back)
