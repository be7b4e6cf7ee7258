"""Graph files: what they may hold, and how mistakes in them are reported."""

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, example, given, settings, strategies as st

from tactograph.graph import GraphError, InputError
from tactograph.graph.files.read_graph import read_graph, read_graphs
from tests.graph.conftest import SLOPES, Write

BACKENDS = "'numpy' or 'opencl' is needed"


def refusal(file: str) -> str:
    with pytest.raises(GraphError) as caught:
        read_graph(file)
    return str(caught.value)


def test_a_graph_file_is_read(write: Write) -> None:
    graph = read_graph(write(SLOPES))
    assert list(graph.nodes) == ["height", "pixel", "slope", "again"]
    assert graph.nodes["slope"].inputs == {"height": "height", "pixel": "pixel"}
    assert graph.nodes["pixel"].settings == {"mm": 0.1}
    assert graph.outputs == {"height": "again", "mask": "slope.mask"}
    assert graph.prefer == ("opencl", "numpy")


def test_a_shipped_graph_is_found_by_its_file_name_too() -> None:
    assert read_graph("paper.yaml").hash == read_graph("paper").hash
    assert [graph.hash for graph in read_graphs("paper.yaml")] == [read_graph("paper").hash]


@pytest.mark.parametrize(
    "name", ["nowhere.yaml", "no/where", "a" * 300 + ".yaml", "a\0b.yaml", "", ".", "/", "..yaml"]
)
def test_a_missing_file_is_an_input_error(name: str) -> None:
    with pytest.raises(InputError):
        read_graph(name)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("format: 1", "format: 2", "2:1: format: this version reads format 1, not 2"),
        ("format: 1", "format: true", "2:1: format: this version reads format 1, not True"),
        ("format: 1\n", "", "2:1: format: 'format' is missing"),
        ("title:", "titel:", "3:1: titel: unknown key 'titel'; did you mean 'title'?"),
        ("nodes:", "knots:", "knots: unknown key 'knots'"),
        ("kind: path", "kind: file", "params.file.kind: 'path', 'number', 'integer', 'text'"),
        ("{kind: path, help", "{kind: path, default: 3, help", "default: a path is needed, not 3"),
        ("{kind: path, help", "{kind: flag, default: no, help", "true or false is needed, not 'n"),
        ("{kind: path, help", "{kind: numbers, default: [no], help", "a list of numbers is need"),
        ("{kind: path, help", "{help", "params.file.kind: 'kind' is missing"),
        ("with: {mm", "wiht: {mm", "nodes.pixel.wiht: unknown key 'wiht'; did you mean 'with'?"),
        ("with: {mm", "settings: {mm", "nodes.pixel.settings: unknown key 'settings'"),
        ("in: {slope", "inputs: {slope", "nodes.again.inputs: unknown key 'inputs'"),
        ("op: pixel_size, ", "", "nodes.pixel.op: 'op' is missing"),
        ("op: pixel_size", "op: 5", "nodes.pixel.op: text is needed, not 5"),
        ("op: pixel_size", "op: a.b", "nodes.pixel.op: 'a.b' is not a name"),
        ("{mm: 0.1}", "5", "nodes.pixel.with: a mapping is needed, not 5"),
        ("{mm: 0.1}", "{mm mm: 1}", "nodes.pixel.with.mm mm: 'mm mm' is not a name"),
        ("height: height,", "height: 5,", "nodes.slope.in.height: text is needed, not 5"),
        ("height: height,", "height: a..b,", "nodes.slope.in.height: 'a..b' is not a name"),
        ("{height: again", "{'he-ight': again", "outputs.he-ight: 'he-ight' is not a name"),
        ("outputs:", "prefer: [cuda]\noutputs:", f"prefer[0]: {BACKENDS}"),
        ("outputs:", "prefer: []\noutputs:", "prefer: at least one is needed"),
        ("outputs:", "prefer: opencl\noutputs:", "prefer: a list is needed, not 'opencl'"),
        ("mm: 0.1}}", "mm: 0.1}, backend: gpu}", f"nodes.pixel.backend: {BACKENDS}"),
        ("mm: 0.1}}", "mm: 0.1}, neutral: no}", "neutral: true or false is needed, not 'no'"),
        ("title:", "'[key]': 1\ntitle:", "[key]: unknown key '[key]'"),
        ("title: H", "title: [H]\n#", "title: text is needed, not ['H']"),
        ("outputs:", "patch: []\noutputs:", "patch: 'patch' needs 'extends'"),
    ],
)  # fmt: skip
def test_a_mistake_is_reported_with_its_place(
    write: Write, old: str, new: str, message: str
) -> None:
    assert SLOPES.count(old) >= 1
    file = write(SLOPES.replace(old, new, 1))
    error = refusal(file)
    assert error.startswith(f"{file}:")
    assert message in error
    line = int(error.removeprefix(f"{file}:").split(":")[0])
    assert line <= SLOPES.count("\n") + 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        *((text, "mapping with 'format: 1'") for text in ("5", "[1]", "text", "null", "---")),
        ("format: 1\nnodes: {}", "a graph needs at least one node"),
        ("format: 1\nextends: paper\nnodes: {}", ":3:1: nodes: a file that extends another"),
        ("format: 1\nextends: graph.yaml", "loop: graph.yaml -> graph.yaml"),
    ],
)
def test_a_text_that_is_no_graph_is_refused(write: Write, text: str, message: str) -> None:
    assert message in refusal(write(text))


def test_a_long_value_is_shortened_in_the_message(write: Write) -> None:
    assert len(refusal(write(f"format: 1\nprefer: {'x' * 5000}"))) < 300


def test_a_param_without_a_default_is_required(write: Write) -> None:
    params = read_graph(
        write(SLOPES.replace("params:", "params:\n  a: {kind: text, default: null}"))
    ).params
    assert params["file"].required
    assert not params["a"].required


def test_a_variant_states_only_its_differences(write: Write) -> None:
    base = read_graph(write(SLOPES, "base.yaml"))
    change = "prefer: [numpy]\noutputs: {mask: null}\npatch: [{set: pixel, with: {mm: 0.2}}]"
    variant = read_graph(write(f"format: 1\nextends: base.yaml\n{change}", "variant.yaml"))
    assert variant.nodes["pixel"].settings == {"mm": 0.2}
    assert variant.prefer == ("numpy",)
    assert {"mask": "slope.mask", **variant.outputs} == base.outputs != variant.outputs
    assert variant.title == base.title
    assert variant.hash != base.hash


def test_a_variant_of_a_variant_works(write: Write) -> None:
    write(SLOPES, "base.yaml")
    write("format: 1\nextends: base.yaml\npatch: [{set: pixel, with: {mm: 0.2}}]", "first.yaml")
    write("format: 1\nextends: first.yaml\npatch: [{remove: again}]", "second.yaml")
    third = write(
        "format: 1\nextends: second.yaml\npatch: [{set: slope, with: {steepest: 3}}]\n"
        "outputs: {height: height}\nparams: {file: {kind: path, default: x.npy}}",
        "third.yaml",
    )
    graph = read_graph(third)
    assert list(graph.nodes) == ["height", "pixel", "slope"]
    assert graph.nodes["pixel"].settings == {"mm": 0.2}
    assert graph.nodes["slope"].settings == {"steepest": 3}
    assert not graph.params["file"].required


def test_a_loop_of_extends_is_named(write: Write) -> None:
    write("format: 1\nextends: b.yaml", "a.yaml")
    write("format: 1\nextends: c.yaml", "b.yaml")
    file = write("format: 1\nextends: a.yaml", "c.yaml")
    assert "'extends' runs in a loop: c.yaml -> a.yaml -> b.yaml -> c.yaml" in refusal(file)


@pytest.mark.parametrize("name", ["nowhere.yaml", "nowhere", "a" * 300 + ".yaml"])
def test_a_missing_base_is_reported_at_the_line_that_names_it(write: Write, name: str) -> None:
    file = write(f"format: 1\nextends: {name}")
    assert refusal(file).startswith(f"{file}:2:1: extends:")


def test_an_error_in_the_base_is_placed_in_the_base(write: Write) -> None:
    base = write("format: 1\nnods: {}", "base.yaml")
    assert refusal(write("format: 1\nextends: base.yaml")).startswith(f"{base}:2:1: nods:")


def test_the_hash_depends_on_the_computation_and_not_on_titles_and_help(write: Write) -> None:
    plain = read_graph(write(SLOPES)).hash
    other_words = SLOPES.replace("Height to", "From height to").replace("a height map", "a map")
    assert read_graph(write(other_words + "# a remark")).hash == plain
    assert read_graph(write(SLOPES.replace("0.1", "0.11"))).hash != plain


patient = settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
TREES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
    | st.sampled_from(["paper", "pixel_size", "opencl", "cal.flat", "$x", "graph.yaml"]),
    lambda inner: st.lists(inner, max_size=3)
    | st.dictionaries(
        st.sampled_from(
            ["op", "in", "with", "set", "to", "backend", "neutral", "kind", "default", "a"]
        ) | st.text(max_size=4),
        inner,
        max_size=3,
    ),
    max_leaves=8,
)  # fmt: skip


@patient
@given(
    st.dictionaries(
        st.sampled_from(["title", "extends", "params", "prefer", "nodes", "patch", "outputs"])
        | st.text(max_size=4),
        TREES,
        max_size=4,
    )
)
def test_any_mapping_is_a_graph_or_an_input_error(write: Write, content: dict[str, object]) -> None:
    text = json.dumps({"format": 1, **content})
    _graph_or_error(write(text))


@patient
@given(st.text(max_size=100))
@example("\r{")
def test_any_text_is_a_graph_or_an_input_error(write: Write, text: str) -> None:
    _graph_or_error(write(f"format: 1\n{text}"))


@patient
@given(st.data())
def test_a_random_edit_of_a_file_is_a_graph_or_an_input_error(
    write: Write, data: st.DataObject
) -> None:
    start = data.draw(st.integers(0, len(SLOPES)))
    length = data.draw(st.integers(0, 20))
    edit = data.draw(st.text(alphabet=":{}[],-&*!%#'\" \n\tx1", max_size=3))
    _graph_or_error(write(SLOPES[:start] + edit + SLOPES[start + length :]))


@patient
@given(content=st.binary(max_size=100))
def test_any_bytes_are_a_graph_or_an_input_error(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "graph.yaml"
    file.write_bytes(content)
    _graph_or_error(str(file))


def _graph_or_error(file: str) -> None:
    try:
        assert read_graph(file).hash
    except InputError as error:
        assert str(error)  # noqa: PT017
