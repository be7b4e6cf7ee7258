"""Pass 3: sizes bind across the graph, and clash before anything runs."""

from contextlib import nullcontext

import pytest

from tactograph.graph import GraphError, InputError
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.plan.make_plan import make_plan
from tactograph.graph.plan.plan import Plan
from tactograph.graph.plan.sizes import Bound, Symbol
from tests.graph.conftest import SLOPES, STREAM, Write

pytestmark = pytest.mark.usefixtures("toys")


def planned(file: str) -> Plan:
    graph = read_graph(file)
    return make_plan(graph, graph.placeholders, device=None)


def test_the_two_ends_of_an_edge_have_the_same_sizes(write: Write) -> None:
    plan = planned(write(SLOPES))
    roots = {plan.sizes.root[node, "H"] for node in ("height", "slope", "again")}
    assert len(roots) == 1
    assert plan.sizes.root["height", "W"] not in roots


def test_fixed_sizes_that_differ_clash_before_anything_runs(write: Write) -> None:
    text = SLOPES.replace(
        "outputs: {",
        "  more: {op: three_planes, in: {planes: slope.slope}}\noutputs: {more: more, ",
    )
    with pytest.raises(GraphError) as caught:
        planned(write(text))
    message = str(caught.value)
    assert "graph.yaml:11:" in message
    assert "nodes.more.in.planes: sizes clash: more.planes has 3, slope.slope has 2" in message


def test_fixed_sizes_clash_through_nodes_that_take_any_size(write: Write) -> None:
    text = """
format: 1
nodes:
  z: {op: read_height, with: {file: z.npy}}
  p: {op: pixel_size, with: {mm: 1}}
  s: {op: height_slopes, in: {height: z, pixel: p}}
  any: {op: many_planes, in: {planes: s.slope}}
  three: {op: three_planes, in: {planes: any}}
outputs: {three: three}
"""
    with pytest.raises(GraphError, match=r"three.planes has 3, (s.slope|any.many_planes) has 2"):
        planned(write(text))


def test_a_fixed_size_that_a_node_refuses_is_reported_before_anything_runs(write: Write) -> None:
    text = SLOPES.replace(
        "outputs: {", "  more: {op: many_planes, in: {planes: slope.slope}}\noutputs: {more: more, "
    )
    with pytest.raises(GraphError, match=r"nodes.more.in: slope.slope has size 2: it takes three"):
        planned(write(text))


@pytest.mark.parametrize(
    ("shape", "words", "question"),
    [
        ((6, 4, 5), "6 lights", "and is no image missing"),
        ((3, 7, 5), "7 rows", "neither cropped"),
        ((3, 4, 9), "9 columns", "neither cropped"),
    ],
)
def test_clashing_sizes_of_images_are_reported_by_what_they_count(
    write: Write, shape: tuple[int, int, int], words: str, question: str
) -> None:
    plan = planned(write(STREAM))
    known: dict[Symbol, Bound] = {}
    plan.sizes.bind(known, plan.tasks["cal"], "flat", (3, 4, 5))
    with pytest.raises(InputError, match=rf"^{words}.* from one sensor, {question}"):
        plan.sizes.bind(known, plan.tasks["frames"], "image", shape)


def test_a_size_that_a_node_does_not_take_is_refused_unless_the_node_is_taken_out() -> None:
    takers = "paper_no_shadow", "reconstruct", "precise"
    for name, refused in (("paper", True), *((name, False) for name in takers)):
        plan = planned(name)
        # It names the graphs that do take them.
        named = ".*".join(takers)
        message = rf"shadow: K = 3: the shadow test needs 4 to 8 LEDs.*{named}"
        with pytest.raises(InputError, match=message) if refused else nullcontext():
            plan.sizes.bind({}, plan.tasks["take.frames"], "image", (3, 4, 5))


def test_sizes_of_a_node_are_known_as_soon_as_its_sources_have_run(write: Write) -> None:
    plan = planned(write(SLOPES))
    known: dict[Symbol, Bound] = {}
    assert plan.sizes.sizes_of(plan.tasks["again"], known) == {}
    plan.sizes.bind(known, plan.tasks["height"], "read_height", (24, 32))
    assert plan.sizes.sizes_of(plan.tasks["again"], known) == {"H": 24, "W": 32}
