"""Patch verbs: what each changes, and what each refuses."""

import re

import pytest

from tactograph.graph import GraphError
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.plan.make_plan import make_plan
from tests.graph.conftest import SLOPES, Write


def patched(write: Write, *changes: str) -> Graph:
    write(SLOPES, "base.yaml")
    lines = "".join(f"\n  - {change}" for change in changes)
    return read_graph(write(f"format: 1\nextends: base.yaml\npatch:{lines}", "variant.yaml"))


def refusal(write: Write, *changes: str) -> str:
    with pytest.raises(GraphError) as caught:
        patched(write, *changes)
    return str(caught.value)


def test_all_wrong_changes_are_reported_but_not_their_consequences(write: Write) -> None:
    inserted = "{insert: rest, op: rest_at_border, after: heigt}"
    follows = "{set: rest, with: {width: 2}}"
    with pytest.raises(GraphError) as caught:
        patched(write, "{remove: slop}", inserted, follows, "{set: slope}", "{remove: again}")
    messages = [
        re.sub(r".*patch", "patch", each) for each in (str(caught.value), *caught.value.others)
    ]
    assert messages == [
        "patch[0]: remove: there is no node 'slop'; did you mean 'slope'?",
        "patch[1]: insert: after: there is no node 'heigt'; did you mean 'height'?",
        "patch[3]: set needs 'with' or 'in'",
    ]


def test_set_changes_a_parameter_and_keeps_the_others(write: Write) -> None:
    crop, steepest = "{set: height, with: {crop: %s}}", "{set: slope, with: {steepest: 2}}"
    graph = patched(write, crop % "[0, 0, 2, 2]", steepest)
    assert graph.nodes["height"].settings == {"file": "$file", "crop": [0, 0, 2, 2]}
    assert graph.nodes["slope"].settings == {"steepest": 2}
    graph = patched(write, crop % "null")
    assert graph.nodes["height"].settings == {"file": "$file", "crop": None}


def test_set_changes_inputs_and_removes_them(write: Write) -> None:
    change = "{set: slope, in: {height: again}, with: {steepest: 2}}"
    graph = patched(write, change)
    assert graph.nodes["slope"].inputs == {"height": "again", "pixel": "pixel"}
    slope = patched(write, change, "{set: slope, in: {pixel: null}}").nodes["slope"]
    assert (slope.inputs, slope.settings) == ({"height": "again"}, {"steepest": 2})


def test_replace_keeps_the_inputs_unless_it_states_them(write: Write) -> None:
    graph = patched(write, "{replace: again, op: integrate_frankot_chellappa}")
    assert graph.nodes["again"].op == "integrate_frankot_chellappa"
    assert graph.nodes["again"].inputs == {"slope": "slope.slope", "pixel": "pixel"}
    graph = patched(write, "{replace: again, op: rest_at_border, in: {height: height}}")
    assert graph.nodes["again"].inputs == {"height": "height"}


def test_insert_redirects_the_readers_of_a_value_only_with_after(write: Write) -> None:
    insert = "{insert: rest, op: rest_at_border, in: {height: height}"
    graph = patched(write, insert + "}")
    assert [graph.nodes[name].inputs["height"] for name in ("slope", "rest")] == ["height"] * 2
    graph = patched(write, insert + ", after: height}")
    assert graph.nodes["slope"].inputs["height"] == "rest"
    assert graph.nodes["rest"].inputs["height"] == "height"
    assert patched(write, insert + ", after: again}").outputs["height"] == "rest"


def test_remove_removes_backend_binds_and_neutral_takes_out(write: Write) -> None:
    graph = patched(write, "{remove: again}", "{backend: slope, to: numpy}", "{neutral: slope}")
    assert "again" not in graph.nodes
    assert (graph.nodes["slope"].backend, graph.nodes["slope"].neutral) == ("numpy", True)


def test_changes_are_made_in_order(write: Write) -> None:
    graph = patched(
        write,
        "{insert: rest, op: rest_at_border, in: {height: height}, after: height}",
        "{set: rest, with: {width_px: 5}}",
        "{remove: again}",
    )
    assert graph.nodes["rest"].settings == {"width_px": 5}


@pytest.mark.parametrize("verb", ["set", "replace", "remove", "backend", "neutral"])
def test_a_verb_whose_target_is_absent_is_an_error(write: Write, verb: str) -> None:
    more = {"set": ", with: {a: 1}", "replace": ", op: pixel_size", "backend": ", to: numpy"}
    message = refusal(write, f"{{{verb}: slopes{more.get(verb, '')}}}")
    assert f"patch[0]: {verb}: there is no node 'slopes'; did you mean 'slope'?" in message
    assert "variant.yaml:4:5:" in message


@pytest.mark.parametrize(
    ("after", "message"),
    [
        ("slope.nothing", "nothing reads 'slope.nothing'; of this node 'slope.slope'"),
        ("slope", "nothing reads 'slope'; of this node 'slope.slope', 'slope.mask' can be named"),
        ("slop", "there is no node 'slop'; did you mean 'slope'?"),
        ("hieght.read_height", "there is no node 'hieght'; did you mean 'height'?"),
    ],
)
def test_insert_after_lists_the_values_that_can_be_named(
    write: Write, after: str, message: str
) -> None:
    assert message in refusal(write, f"{{insert: rest, op: rest_at_border, after: {after}}}")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("{set: slope}", "set needs 'with' or 'in'"),
        ("{set: slope, with: null}", "a mapping is needed, not None"),
        ("{set: null, in: {height: again}}", "a list is needed, not None"),
        ("{set: 3, with: {a: 1}}", "patch[0].set[0]: text is needed, not 3"),
        ("{set: slope, with: {a: 4,0}}", "'0' is not a name such as 'cal' or 'cal.flat'; a"),
        ("{replace: slope, op: pixel_size, in: {height: null}}", "only 'set' takes an input away"),
        ("{insert: slope, op: pixel_size}", "insert: there is a node 'slope' already"),
        ("{set: slope, with: {a: 1}, op: x}", "set takes no 'op'"),
        ("{replace: slope}", "replace needs 'op'"),
        ("{replace: slope, op: x, after: height}", "replace takes no 'after'"),
        ("{insert: x}", "insert needs 'op'"),
        ("{insert: x, op: y, to: numpy}", "insert takes no 'to'"),
        ("{remove: slope, in: {a: b}}", "remove takes no 'in'"),
        ("{backend: slope}", "backend needs 'to'"),
        ("{neutral: slope, with: {}}", "neutral takes no 'with'"),
        ("{}", "this one has none"),
        ("{op: x}", "this one has none"),
        ("{set: a, remove: b}", "this one has set and remove"),
        ("{sett: slope}", "unknown key 'sett'; did you mean 'set'?"),
        ("{set: slope, with: 5}", "a mapping is needed, not 5"),
        ("{backend: slope, to: gpu}", "'numpy' or 'opencl' is needed, not 'gpu'"),
        ("remove", "a mapping is needed, not 'remove'"),
    ],
)
def test_a_change_with_too_few_or_too_many_keys_is_refused(
    write: Write, change: str, message: str
) -> None:
    error = refusal(write, change)
    assert "variant.yaml:4:" in error
    assert message in error


def test_an_error_in_a_set_value_is_placed_in_the_patch(write: Write) -> None:
    graph = patched(write, "{set: slope, with: {steepest: 0}}")
    assert "variant.yaml:4:25: patch[0].with.steepest" in graph.nodes["slope"].where(
        "with.steepest"
    )


@pytest.mark.parametrize(
    "change", ["{set: pixel, with: {other: 1}}", "{backend: pixel, to: numpy}", "{neutral: pixel}"]
)
def test_an_error_in_an_unpatched_value_is_placed_in_the_base(write: Write, change: str) -> None:
    graph = patched(write, change)
    where = graph.nodes["pixel"].where("with.mm")
    assert "base.yaml" in where
    assert where.endswith("nodes.pixel.with.mm")
    assert graph.nodes["pixel"].where("op").endswith("nodes.pixel.op")


def test_an_output_knows_the_file_that_states_it(write: Write) -> None:
    write(SLOPES, "base.yaml")
    graph = read_graph(
        write("format: 1\nextends: base.yaml\noutputs: {other: slope.slope}", "variant.yaml")
    )
    assert "variant.yaml:3:11: outputs.other" in graph.where("outputs.other")
    assert "base.yaml" in graph.where("outputs.height")


def plan_refusal(write: Write, *changes: str) -> str:
    graph = patched(write, *changes)
    with pytest.raises(GraphError) as caught:
        make_plan(graph, graph.placeholders, device=None)
    return str(caught.value)


def test_the_removal_of_a_node_that_is_still_read_is_reported_at_the_change(write: Write) -> None:
    message = plan_refusal(write, "{backend: slope, to: numpy}", "{remove: height}")
    assert re.match(r"\S*variant.yaml:5:5: patch\[1\]: takes out 'height', but ", message)
    assert re.search(r"base.yaml:9:\d+: nodes.slope.in.height reads it; change that too", message)
    message = plan_refusal(write, "{remove: again}")
    assert re.match(
        r"\S*variant.yaml:4:5: patch\[0\]: takes out 'again', but .*outputs.height", message
    )
    graph = read_graph(write("format: 1\nextends: paper\npatch: [{remove: raw}]", "variant.yaml"))
    with pytest.raises(GraphError, match=r"variant.yaml:3:9: .*takes out 'integrate.raw', but "):
        make_plan(graph, graph.placeholders, device=None)
    insert = "{insert: again, op: rest_at_border, in: {height: height}}"
    graph = patched(write, "{remove: again}", insert)
    make_plan(graph, graph.placeholders, device=None)  # a node that is inserted anew exists


@pytest.mark.parametrize(
    ("change", "wrong"),
    [
        ("{replace: height, op: pixel_size, in: {}, with: {mm: 0.1}}", "a number is not an array"),
        ("{replace: slope, op: rest_at_border, in: {height: height}}", "has no output 'slope'"),
    ],
)
def test_a_reader_that_does_not_fit_a_replaced_node_is_reported_with_the_change(
    write: Write, change: str, wrong: str
) -> None:
    message = plan_refusal(write, change)
    assert wrong in message
    assert re.search(r"stands at \S*variant.yaml:4:5: patch\[0\]\)$", message)
