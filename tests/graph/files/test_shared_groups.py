"""Groups from files: how a graph finds them, takes over their params, and names their nodes."""

from pathlib import Path
from typing import Any

import pytest

from tactograph.graph import GraphError
from tactograph.graph.files.changes import with_changes
from tactograph.graph.files.read_graph import read_graph, with_overlays

TAKE = """
format: 1
inputs: {}
params:
  count: {kind: integer, help: number of touches}
  rows:  {kind: integer, default: 4}
  level: {default: 1.0}
nodes:
  frames: {op: touches, with: {count: $count, rows: $rows}}
  rest:   {op: at_rest, with: {level: $level}}
  light:  {op: flat_field, in: {image: frames.image, flat: rest.flat, dark: rest.dark}}
outputs: {light: light, frames: frames.image}
"""
MORE = """
format: 1
inputs: {taken: {default: take}}
nodes:
  twice: {op: doubled, in: {image: taken.light}}
  again: {op: doubled, in: {image: taken.frames}}
"""


@pytest.fixture
def graph(tmp_path: Path) -> Path:
    """A graph of two groups from files in the same folder."""
    (tmp_path / "take.group.yaml").write_text(TAKE)
    (tmp_path / "more.group.yaml").write_text(MORE)
    file = tmp_path / "graph.yaml"
    nodes = (
        "  take: {group: take}\n  more: {group: more}\n  last: {op: doubled, in: {image: light}}"
    )
    outputs = "outputs: {last: last, twice: twice, again: more.again}"
    file.write_text(f"format: 1\nnodes:\n{nodes}\n{outputs}\n")
    return file


def patched(graph: Path, *changes: dict[str, Any], **more: Any) -> Any:
    return read_graph({"format": 1, "extends": str(graph), "patch": [*changes], **more})


def test_a_group_that_is_not_defined_is_a_file_in_the_folder_of_the_graph(graph: Path) -> None:
    read = read_graph(graph)
    assert list(read.nodes) == [
        *("take.frames", "take.rest", "take.light", "more.twice", "more.again", "last")
    ]
    (graph.parent / "more.group.yaml").unlink()
    with pytest.raises(GraphError, match=r"nodes\.more\.group: there is no group 'more'"):
        read_graph(graph)


def test_a_graph_takes_over_params_of_groups_as_long_as_a_node_takes_them(graph: Path) -> None:
    params = read_graph(graph).params
    assert {name: (p.kind, p.required, p.default) for name, p in params.items()} == {
        "count": ("integer", True, None),
        "rows": ("integer", False, 4),
    }
    overridden = patched(graph, {"replace": "take", "group": "take", "with": {"rows": 9}})
    assert list(overridden.params) == ["count"]
    assert overridden.entry("frames").settings == {"count": "$count", "rows": 9}
    without = patched(graph, {"replace": "frames", "op": "touches", "in": {}})
    assert not without.params
    stated = patched(graph, params={"rows": {"kind": "integer", "default": 7}})
    assert stated.params["rows"].default == 7


def test_two_groups_cannot_declare_a_param_of_two_kinds(graph: Path) -> None:
    other = graph.parent / "more.group.yaml"
    other.write_text(
        "format: 1\ninputs: {}\nparams: {count: {kind: text}}\n"
        "nodes: {more: {op: touches, with: {count: $count}}}\n"
    )
    with pytest.raises(GraphError, match="kind: the graph has a param 'count'"):
        read_graph(graph)


def test_a_node_in_a_use_can_be_named_without_the_use(graph: Path) -> None:
    read = read_graph(graph)
    assert read.entry("last").inputs == {"image": "take.light"}
    assert read.outputs["twice"] == "more.twice"
    assert read.in_short("take.rest") == "rest"
    changed = with_changes(read, {"rest.level": 2.0})
    assert changed.nodes["take.rest"].settings == {"level": 2.0}
    noted = patched(graph, {"insert": "note", "op": "doubled", "in": {"image": "light"},
                            "after": "light"})  # fmt: skip
    assert noted.entry("twice").inputs == {"image": "note"}
    assert noted.entry("note").inputs == {"image": "take.light"}


def test_a_name_means_the_nearest_node_and_is_refused_where_several_are_as_near(
    graph: Path,
) -> None:
    nodes = {"rest": {"op": "at_rest"}, "use": {"group": "take"}, "far": {"group": "outer"}}
    outer = {"nodes": {"use": {"group": "take"}}}
    file = {"extends": str(graph.parent / "take.group.yaml")}
    base = {"format": 1, "groups": {"take": file, "outer": outer}, "nodes": nodes}
    read = read_graph({**base, "outputs": {"light": "light"}})
    assert read.outputs == {"light": "use.light"}
    assert read.in_full("rest") == "rest"
    two = {**base, "nodes": {**nodes, "other": {"group": "take"}}, "outputs": {"light": "use"}}
    two["outputs"] = {"light": "use.light"}
    with pytest.raises(GraphError, match=r"no node 'light'; say which: use\.light, other\.light"):
        with_changes(read_graph(two), {"light.floor": 0.1})


def test_an_input_may_be_a_use(graph: Path) -> None:
    read = read_graph(graph)
    assert read.entry("twice").inputs == {"image": "take.light"}
    assert read.entry("again").inputs == {"image": "take.frames.image"}
    lone = {"op": "doubled", "in": {"image": "take"}}
    with pytest.raises(GraphError, match="'take' uses the group 'take'; say which output"):
        patched(graph, {"insert": "lone", **lone})


def test_shipped_overlays_reach_nodes_in_groups() -> None:
    graph = with_overlays(read_graph("reconstruct"), ["follow_drift"])
    assert graph.nodes["cells.drift"].inputs["before"] == "previous.relight.drift_2"
