"""Pass 1: every name in a graph means something, and there is no cycle."""

import re
from typing import Any

import pytest

from tactograph.graph import GraphError, InputError
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.plan.draft import Draft, Value
from tactograph.graph.plan.names import bind
from tests.graph.conftest import SLOPES, STREAM, Write


def bound(
    file: str, *, sinks: bool = True, stand_ins: frozenset[str] = frozenset(), **values: Any
) -> Draft:
    graph = read_graph(file)
    return bind(graph, {**graph.placeholders, **values}, sinks=sinks, stand_ins=stand_ins)


def refusal(file: str, **values: Any) -> str:
    with pytest.raises(GraphError) as caught:
        bound(file, **values)
    return str(caught.value)


def test_a_bare_reference_means_the_only_output(write: Write) -> None:
    draft = bound(write(SLOPES))
    assert draft.tasks["slope"].reads["height"] == Value("height", "read_height")
    assert draft.outputs["height"] == Value("again", "integrate_dct")


def test_the_value_of_a_param_takes_its_place(write: Write) -> None:
    draft = bind(read_graph(write(SLOPES)), {"file": "a.npy"}, sinks=True, stand_ins=frozenset())
    assert str(draft.tasks["height"].settings["file"]) == "a.npy"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("op: height_slopes", "op: heigt_slopes",
         "9:12: nodes.slope.op: no node is called 'heigt_slopes'; did you mean 'height_slopes'?"),
        ("in: {height: height, pixel: pixel}", "in: {height: height}",
         "nodes.slope.in: node 'height_slopes' needs the input 'pixel'"),
        (", in: {height: height, pixel: pixel}", "",
         "nodes.slope.in: node 'height_slopes' needs the inputs 'height', 'pixel'"),
        ("pixel: pixel}}\n  again", "pixel: pixel, mask: pixel}}\n  again",
         "nodes.slope.in.mask: node 'height_slopes' has no input 'mask'"),
        ("{height: height, p", "{hieght: height, p",
         "slope.in.hieght: node 'height_slopes' has no input 'hieght'; did you mean 'height'"),
        ("height: height,", "height: hight,",
         "nodes.slope.in.height: there is no node 'hight'; did you mean 'height'?"),
        ("slope: slope.slope", "slope: slope",
         "node 'slope' has several outputs; name one of slope.slope, slope.mask"),
        ("slope: slope.slope", "slope: slope.slop",
         "nodes.again.in.slope: node 'slope' has no output 'slop'; did you mean 'slope'?"),
        ("{mm: 0.1}", "{mm: 0}",
             "nodes.pixel.with.mm: input should be greater than or equal to 0.0001, not 0"),
        ("{mm: 0.1}", "{mmm: 0.1}", "node 'pixel_size' has no parameter 'mmm'; did you mean 'mm'?"),
        (", with: {file: $file}", "",
         "nodes.height.with.file: node 'read_height' needs the parameter"),
        ("file: $file", "file: $fiel", "the graph has no param 'fiel'; did you mean 'file'?"),
        ("height: again", "height: agian",
         "11:11: outputs.height: there is no node 'agian'; did you mean 'again'?"),
        ("mask: slope.mask", "mask: slope.flag",
         "outputs.mask: node 'slope' has no output 'flag'; it has slope, mask"),
    ],
)  # fmt: skip
def test_an_unknown_name_is_an_error_with_its_place(
    write: Write, old: str, new: str, message: str
) -> None:
    assert SLOPES.count(old) == 1
    file = write(SLOPES.replace(old, new))
    error = refusal(file)
    assert error.startswith(f"{file}:")
    assert message in error


@pytest.mark.parametrize(
    ("nodes", "read", "message"),
    [
        ("a: {op: join_metrics}", "a", "nodes.a.in: node 'join_metrics' needs at least one input"),
        ("a: {op: rest_at_border, in: {height: a}}", "a", "cycle: a -> a"),
        ("a: {op: rest_at_border, in: {height: b}, neutral: true}\n"
         "  b: {op: rest_at_border, in: {height: a}, neutral: true}", "a",
         "the neutral nodes pass on one another in a cycle"),
        ("one: {op: touches}\n  two: {op: touches}\n"
         "  a: {op: watched, in: {image: one.image, truth: two.truth}}", "a",
         "a graph has one stream, and 'one' begins it"),
        ("one: {op: touches}\n  a: {op: noted, in: {image: one.image}}", "a",
         "outputs.read: node 'a' only writes"),
        ("p: {op: pixel_size, with: {mm: 1}}", "",
         "nothing to do: the graph has neither outputs nor sinks"),
    ],
)  # fmt: skip
def test_a_graph_that_cannot_run_is_refused(
    toys: list[str], write: Write, nodes: str, read: str, message: str
) -> None:
    outputs = f"\noutputs: {{read: {read}}}" if read else ""
    assert message in refusal(write(f"format: 1\nnodes:\n  {nodes}{outputs}"))


def test_a_wrong_value_of_the_user_is_reported_by_its_param(write: Write) -> None:
    """Not by its place in a file that the user does not know."""
    text = SLOPES.replace("params:", "params:\n  mm: {kind: number}", 1)
    file = write(text.replace("{mm: 0.1}", "{mm: $mm}"))
    name = read_graph(file).name
    assert refusal(file, mm=0).startswith(f"{name}: mm: input should be greater than")
    file = write(SLOPES.replace("{mm: 0.1}", "{mm: 1, mmm: $file}"))
    assert "nodes.pixel.with.mmm: " in refusal(file)


def test_a_cycle_is_printed(write: Write) -> None:
    text = """
format: 1
nodes:
  pixel: {op: pixel_size, with: {mm: 1}}
  a: {op: rest_at_border, in: {height: c}}
  b: {op: height_slopes, in: {height: a, pixel: pixel}}
  c: {op: integrate_dct, in: {slope: b.slope, pixel: pixel}}
outputs: {c: c}
"""
    message = refusal(write(text))
    assert "the graph has a cycle: " in message
    walk = message.partition("cycle: ")[2].split(" -> ")
    assert walk[0] == walk[-1]
    assert sorted(walk[1:]) == ["a", "b", "c"]


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ("{set: light, in: {image: slope}}", "patch[0].in.image"),
        ("{set: raw, in: {slope: height}}", "patch[0].in.slope"),
    ],
)
def test_a_cycle_that_a_patch_closes_is_reported_at_the_patch(
    write: Write, change: str, where: str
) -> None:
    """It was reported at the file that is patched, where nothing is wrong."""
    file = write(f"format: 1\nextends: paper\npatch:\n  - {change}\n")
    assert re.match(rf"{re.escape(str(file))}:4:\d+: {re.escape(where)}: the graph", refusal(file))


def test_a_node_that_no_output_needs_is_not_run(write: Write) -> None:
    draft = bound(write(SLOPES.replace("height: again", "height: height")))
    assert draft.unused == ["again"]
    assert "again" not in draft.tasks


def test_sinks_run_unless_they_are_left_out(toys: list[str], write: Write) -> None:
    file = write(STREAM)
    assert "save" in bound(file).tasks
    assert "save" not in bound(file, sinks=False).tasks


def test_only_nodes_that_read_the_stream_are_part_of_it(toys: list[str], write: Write) -> None:
    tasks = bound(write(STREAM)).tasks
    assert {name for name, task in tasks.items() if task.stream} == {
        "frames", "light", "score", "save"
    }  # fmt: skip


def test_a_neutral_node_that_passes_on_an_input_is_not_in_the_plan(
    toys: list[str], write: Write
) -> None:
    text = STREAM.replace("dark: cal.dark}}", "dark: cal.dark}, neutral: true}")
    draft = bound(write(text))
    assert "light" not in draft.tasks
    assert "cal" not in draft.tasks
    assert draft.outputs["light"] == Value("frames", "image")
    assert draft.passed == {"light": Value("frames", "image")}


def test_a_chain_of_neutral_nodes_passes_on_its_first_input(write: Write) -> None:
    text = """
format: 1
nodes:
  z: {op: read_height, with: {file: z.npy}}
  a: {op: rest_at_border, in: {height: z}, neutral: true}
  b: {op: rest_at_border, in: {height: a}, neutral: true}
outputs: {b: b}
"""
    assert bound(write(text)).outputs["b"] == Value("z", "read_height")


@pytest.mark.parametrize(
    ("node", "message"),
    [
        ("{op: rest_at_border, neutral: true}", "a.in: node 'rest_at_border' needs the input"),
        ("{op: rest_at_border, in: {height: zz}, neutral: true}", "there is no node 'zz'"),
        ("{op: rest_at_border, in: {height: z.y}, neutral: true}", "node 'z' has no output 'y'"),
        ("{op: rest_at_border, in: {height: s}, neutral: true}", "node 's' has several outputs"),
        ("{op: integrate_dct, in: {slope: s.slope}, neutral: true}", "has no neutral value"),
    ],
)  # fmt: skip
def test_a_neutral_node_is_checked_too(write: Write, node: str, message: str) -> None:
    text = f"""
format: 1
nodes:
  z: {{op: read_height, with: {{file: z.npy}}}}
  p: {{op: pixel_size, with: {{mm: 1}}}}
  s: {{op: height_slopes, in: {{height: z, pixel: p}}}}
  a: {node}
outputs: {{a: a}}
"""
    error = refusal(write(text))
    assert "graph.yaml:7:" in error
    assert message in error


def test_a_record_is_read_with_all_its_fields() -> None:
    draft = bound("paper", sinks=False)
    reads = draft.tasks["look_up.coarse"].reads
    assert reads["index.axes"] == Value("look_up.index", "axes")


@pytest.mark.parametrize(
    ("base", "change", "message"),
    [
        ("paper",
         "{replace: coarse, op: lut_nearest, in: {light: light, shadow: shadow, index: cal}}",
         "'index' takes a node that gives all of a LutIndex (entries, "),
        ("reconstruct", "{replace: matt, op: matt_light, in: {film: cal.diffuse}}",
         "'film' takes a node that gives all of a Film (lights, "),
    ],
)  # fmt: skip
def test_a_record_is_read_from_a_node_that_gives_one(
    write: Write, base: str, change: str, message: str
) -> None:
    file = write(f"format: 1\nextends: {base}\npatch:\n  - {change}")
    error = refusal(file)
    assert error.startswith(f"{file}:4:")
    assert message in error
    assert "' is not one" in error


def test_a_node_that_gives_more_than_a_record_feeds_it() -> None:
    """A calibration holds a film among other things."""
    draft = bound("reconstruct", sinks=False)
    reads = draft.tasks["matt"].reads
    assert reads["film.diffuse"] == Value("take.cal", "diffuse")
    assert not any(name.startswith("film.flat.") or name == "film.lut_light" for name in reads)


def test_a_value_for_an_unknown_param_is_refused(write: Write) -> None:
    with pytest.raises(InputError, match="has no parameter 'fiel'; did you mean 'file'"):
        bound(write(SLOPES), fiel="x")


def test_a_missing_value_is_named_with_its_help(write: Write) -> None:
    with pytest.raises(InputError, match=r"graph needs file=... \(a height map\)"):
        bind(read_graph(write(SLOPES)), {}, sinks=True, stand_ins=frozenset())


def test_only_a_source_can_be_replaced_by_the_caller(write: Write) -> None:
    with pytest.raises(InputError, match=r"no source node 'slope'; it has: height$"):
        bound(write(SLOPES), stand_ins=frozenset({"slope"}))
