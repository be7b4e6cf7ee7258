"""Pictures of a plan."""

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
from tactograph.graph.show.draw_svg import to_svg
from tactograph.graph.show.sketch import Sketch, fold
from tests.each import each
from tests.graph.conftest import SLOPES, Write
from tests.graph.plan.plans import planned


def unfolded(plan: Plan) -> Sketch:
    return sketch_of(plan)


def folded(plan: Plan) -> Sketch:
    return fold(sketch_of(plan))


def test_every_node_and_every_edge_is_drawn_once(write: Write, device: OpenCL) -> None:
    plan = planned(write(SLOPES), device)
    svg = to_svg(unfolded(plan))
    assert sorted(re.findall(r'data-node="(\S+)"', svg)) == sorted(plan.tasks)
    assert svg.count('marker-end="url(#tip)"') == len({(a, b) for a, b, _ in unfolded(plan).edges})


def test_the_back_ends_have_different_colours(write: Write, device: OpenCL) -> None:
    svg = to_svg(folded(planned(write(SLOPES), device)))
    assert len({*re.findall(r'fill="(#\w+)" stroke="#555"', svg)}) == 2


@each("name", shipped_names())
def test_every_graph_is_drawn_and_every_edge_joins_two_nodes(name: str, device: OpenCL) -> None:
    plan = planned(name, device)
    assert to_svg(folded(plan)).startswith("<svg ")
    assert all({a, b} <= plan.tasks.keys() for a, b, _ in unfolded(plan).edges)


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
    svg = to_svg(unfolded(planned(write(SLOPES, "a<b&c.yaml"), None)))
    assert ElementTree.fromstring(svg)[0].text == "a<b&c"


def test_a_use_of_a_group_is_one_box(device: OpenCL) -> None:
    plan = planned("reconstruct", device)
    boxes = {box.name: box for box in folded(plan).boxes}
    assert boxes["rough"].label == "4 x rough_pass: 31 nodes"
    assert not [name for name in boxes if "." in name]
    assert boxes.keys() == {name.partition(".")[0] for name in plan.tasks}
    assert "4 x rough_pass: 31 nodes" in to_svg(folded(plan))


def test_a_use_that_reads_a_value_derived_from_its_own_is_not_folded(device: OpenCL) -> None:
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


@pytest.mark.parametrize(("sketched", "widest"), [(folded, 1500), (unfolded, 4000)])
@pytest.mark.parametrize("name", ["paper", "reconstruct", "precise", "calibrate"])
def test_a_picture_fits_a_page_with_boxes_apart_and_edges_downwards(
    name: str, sketched: Callable[[Plan], Sketch], widest: float, device: OpenCL
) -> None:
    sketch = sketched(planned(name, device))
    svg = to_svg(sketch)
    assert float(re.search(r'width="(\d+)"', svg)[1]) < widest  # type: ignore[index]
    rect = r'<rect x="([\d.]+)" y="([\d.]+)" width="(\d+)" height="(\d+)"'
    boxes = [Box(*map(float, numbers)) for numbers in re.findall(r"<g [^>]*>\n" + rect, svg)]
    assert len(boxes) == len(sketch.boxes)
    for number, box in enumerate(boxes):
        assert not any(box.meets(other) for other in boxes[number + 1 :])
    edges = re.findall(r'<path d="M[\d.]+ ([\d.]+)C.*?([\d.]+)" fill="none" stroke="#777"', svg)
    assert edges
    assert all(float(start) < float(end) for start, end in edges)
    assert not re.search(r" ([\d.]+)V\1\"", svg), "a tip points down, as the last line does"
    for how, words in re.findall(r"<text ([^>]*)>([^<]*)<", svg):
        letter_px = 6.8  # of 11 px type, some of it bold
        assert len(words) * letter_px < boxes[0].width or "textLength" in how, words


def test_a_folded_picture_shows_the_total_time_of_a_use(device: OpenCL) -> None:
    plan = planned("reconstruct", device)
    svg = to_svg(folded(plan), {"rough.1.label": 2.0, "rough.2.matt": 1.0, "label": 8.0})
    assert "4 x rough_pass: 31 nodes, 3 ms" in svg
    assert "label_lights, 8 ms" in svg


def test_a_value_of_the_previous_item_is_a_dashed_edge(device: OpenCL) -> None:
    plan = planned("reconstruct_follow_drift", device)
    back = folded(plan).recalls
    assert back
    assert to_svg(folded(plan)).count("stroke-dasharray") == len(back)
