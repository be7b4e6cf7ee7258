"""Changes to groups: a variant changes one use, all uses, or the nodes of the group."""

from typing import Any

import pytest

from tactograph.graph import GraphError
from tactograph.graph.files.changes import with_changes
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.files.read_graph import read_graph
from tests.graph.conftest import Write

PASSES = """
format: 1
groups:
  pass:
    inputs:
      height: {}
      pixel:  {default: size}
      before: {default: null}
    params:
      steepest: {default: 3.0}
    nodes:
      slope: {op: height_slopes, in: {height: height, pixel: pixel}, with: {steepest: $steepest}}
      raw:   {op: integrate_dct, in: {slope: slope.slope, pixel: pixel, before: before}}
    outputs: {height: raw}
  pair:
    inputs:
      height: {}
    params:
      steepest: {default: 2.0}
    nodes:
      one: {group: pass, in: {height: height}, with: {steepest: $steepest}}
      two: {group: pass, in: {height: one}}
    outputs: {height: two.height}
nodes:
  start:  {op: read_height, with: {file: start.npy}}
  size:   {op: pixel_size, with: {mm: 0.1}}
  pass_1: {group: pass, in: {height: start}}
  pass_2: {group: pass, in: {height: pass_1, before: previous.pass_2.height}, with: {steepest: 5.0}}
  both:   {group: pair, in: {height: pass_2.height}}
  save:   {op: noted, in: {image: both.height}}
outputs: {height: pass_2.height}
"""


def patched(write: Write, *changes: str, more: str = "") -> Graph:
    write(PASSES, "base.yaml")
    lines = "".join(f"\n  - {change}" for change in changes)
    return read_graph(write(f"format: 1\nextends: base.yaml\n{more}patch:{lines}\n", "v.yaml"))


def refusal(write: Write, *changes: str, more: str = "") -> str:
    with pytest.raises(GraphError) as caught:
        patched(write, *changes, more=more)
    return str(caught.value)


def settings(graph: Graph, node: str = "slope") -> dict[str, dict[str, Any]]:
    """The settings of a node of the group `pass` in each use."""
    return {
        name.removesuffix(f".{node}"): dict(entry.settings)
        for name, entry in graph.nodes.items()
        if name.endswith(f".{node}")
    }


def steepest(graph: Graph) -> dict[str, float]:
    return {use: its["steepest"] for use, its in settings(graph).items()}


AS_WRITTEN = {"pass_1": 3.0, "pass_2": 5.0, "both.one": 2.0, "both.two": 3.0}


def test_a_change_to_one_use_changes_its_node_alone(write: Write) -> None:
    graph = patched(write, "{set: pass_2.slope, with: {steepest: 9.0}}")
    assert steepest(graph) == AS_WRITTEN | {"pass_2": 9.0}
    graph = patched(write, "{replace: pass_2.raw, op: sum, in: {slope: pass_1.slope.slope}}")
    assert graph.nodes["pass_2.raw"].op == "sum"
    assert graph.nodes["pass_2.raw"].inputs == {"slope": "pass_1.slope.slope"}
    assert graph.nodes["pass_1.raw"].op == "integrate_dct"


def test_a_change_to_a_node_of_a_group_changes_every_use(write: Write) -> None:
    graph = patched(write, "{set: pass.slope, with: {steepest: 9.0}}", "{neutral: pass.raw}")
    assert set(steepest(graph).values()) == {9.0}
    assert [name for name, entry in graph.nodes.items() if entry.neutral] == [
        "pass_1.raw", "pass_2.raw", "both.one.raw", "both.two.raw",
    ]  # fmt: skip
    graph = patched(write, "{backend: pass.raw, to: numpy}")
    assert graph.nodes["both.two.raw"].backend == "numpy"
    graph = patched(write, "{remove: pass.slope}")
    assert steepest(graph) == {}


def test_a_change_to_a_group_can_read_only_what_the_group_can_read(write: Write) -> None:
    change = "{replace: pass.raw, op: sum, in: {slope: slope, first: height, last: before}}"
    graph = patched(write, change)
    assert graph.nodes["pass_1.raw"].inputs == {"slope": "pass_1.slope", "first": "start"}
    assert graph.nodes["pass_2.raw"].inputs == {
        "slope": "pass_2.slope",
        "first": "pass_1.raw",
        "last": "previous.pass_2.raw",
    }
    change = "{replace: pass.raw, op: sum, in: {slope: start}}"
    assert "(used by" in (message := refusal(write, change))
    assert "the group 'pass' has no node or input 'start'" in message


def test_a_node_inserted_into_a_group_is_read_in_place_of_its_input(write: Write) -> None:
    change = "{insert: pass.rest, op: rest_at_border, in: {height: raw}, after: raw}"
    graph = patched(write, change)
    assert graph.nodes["pass_2.rest"].inputs == {"height": "pass_2.raw"}
    assert graph.nodes["pass_2.slope"].inputs["height"] == "pass_1.rest"
    assert graph.nodes["pass_2.raw"].inputs["before"] == "previous.pass_2.rest"
    assert graph.nodes["save"].inputs == {"image": "both.two.rest"}
    assert graph.outputs == {"height": "pass_2.rest"}
    more = "{insert: last, op: noted, in: {image: pass_1.height}}"
    assert patched(write, change, more).nodes["last"].inputs == {"image": "pass_1.rest"}


CALM = """
groups:
  calm:
    inputs: {height: {}}
    params: {margin: {default: 2}}
    nodes: {n: {op: rest_at_border, in: {height: height}, with: {margin: $margin}}}
    outputs: {height: n}
  calmer:
    inputs: {height: {}}
    params: {margin: {default: 3}}
    nodes:
      first: {group: calm, in: {height: height}, with: {margin: $margin}}
      last:  {op: rest_at_border, in: {height: first}}
    outputs: {height: last}
"""


def test_a_group_that_uses_another_can_be_inserted_into_a_group(write: Write) -> None:
    change = "{insert: pass.calm, group: calmer, in: {height: raw}, after: raw}"
    set_, read = "{set: pass_2.calm, with: {margin: 5}}", "{insert: x, op: noted, in: {image: p}}"
    use = "{insert: p, group: pass, in: {height: start}}"
    graph = patched(write, change, set_, use, read, more=CALM)
    for path in ("pass_1", "pass_2", "both.one", "both.two", "p"):
        assert graph.nodes[f"{path}.calm.first.n"].inputs == {"height": f"{path}.raw"}
        assert graph.nodes[f"{path}.calm.last"].inputs == {"height": f"{path}.calm.first.n"}
    assert graph.nodes["pass_2.slope"].inputs["height"] == "pass_1.calm.last"
    assert graph.nodes["pass_2.raw"].inputs["before"] == "previous.pass_2.calm.last"
    assert graph.nodes["x"].inputs == {"image": "p.calm.last"}
    assert graph.nodes["pass_1.calm.first.n"].settings == {"margin": 3}
    assert graph.nodes["pass_2.calm.first.n"].settings == {"margin": 5}


def test_a_group_can_replace_a_node_of_a_group(write: Write) -> None:
    graph = patched(
        write, "{replace: pass.raw, op: rest_at_border, in: {height: slope}}",
        "{replace: pass.slope, group: calmer, in: {height: height}}", more=CALM,
    )  # fmt: skip
    assert graph.nodes["both.two.slope.first.n"].inputs == {"height": "both.one.raw"}
    assert graph.nodes["both.two.raw"].inputs == {"height": "both.two.slope.last"}


def test_a_group_can_be_inserted_into_one_use(write: Write) -> None:
    change = "{insert: pass_1.calm, group: calmer, in: {height: pass_1.raw}, after: pass_1.raw}"
    graph = patched(write, change, more=CALM)
    assert graph.nodes["pass_1.calm.first.n"].inputs == {"height": "pass_1.raw"}
    assert graph.nodes["pass_2.slope"].inputs["height"] == "pass_1.calm.last"
    assert "pass_2.calm" not in graph.uses


def test_params_of_a_use_reach_the_nodes_that_take_them(write: Write) -> None:
    graph = patched(write, "{set: pass_1, with: {steepest: 9.0}}")
    assert steepest(graph) == AS_WRITTEN | {"pass_1": 9.0}
    graph = patched(write, "{set: both, with: {steepest: 9.0}}")
    assert steepest(graph) == AS_WRITTEN | {"both.one": 9.0}
    graph = patched(write, "{set: pass, with: {steepest: 9.0}}")
    assert set(steepest(graph).values()) == {9.0}
    graph = patched(
        write, "{set: pass, with: {steepest: 9.0}}", "{insert: p, group: pass, in: {height: start}}"
    )
    assert steepest(graph)["p"] == 9.0


def test_the_later_of_two_changes_wins(write: Write) -> None:
    one = "{set: pass_1.slope, with: {steepest: 9.0}}"
    every = "{set: pass.slope, with: {steepest: 8.0}}"
    assert steepest(patched(write, one, every))["pass_1"] == 8.0
    assert steepest(patched(write, every, one))["pass_1"] == 9.0


def test_a_back_end_may_be_that_of_all_nodes_of_a_use(write: Write) -> None:
    graph = patched(write, "{backend: pass_1, to: numpy}")
    bound = [name for name, entry in graph.nodes.items() if entry.backend]
    assert bound == ["pass_1.slope", "pass_1.raw"]


def test_a_use_is_removed_and_replaced_with_all_its_nodes(write: Write) -> None:
    graph = patched(write, "{remove: both}", "{remove: save}")
    assert list(graph.nodes) == [
        *("start", "size", "pass_1.slope", "pass_1.raw", "pass_2.slope", "pass_2.raw")
    ]
    graph = patched(write, "{replace: pass_1, group: pass, in: {height: both.one.raw}}")
    assert graph.nodes["pass_1.slope"].inputs["height"] == "both.one.raw"
    assert graph.nodes["pass_2.slope"].inputs["height"] == "pass_1.raw"
    graph = patched(write, "{replace: pass_1, group: pair}")
    assert graph.nodes["pass_1.one.slope"].inputs["height"] == "start"
    assert graph.nodes["pass_2.slope"].inputs["height"] == "pass_1.two.raw"
    graph = patched(write, "{replace: pass_1, op: rest_at_border, in: {height: start}}")
    assert graph.nodes["pass_2.slope"].inputs["height"] == "pass_1.height"
    graph = patched(write, "{replace: save, group: pass, in: {height: start}}")
    assert graph.nodes["save.slope"].inputs == {"height": "start", "pixel": "size"}


def test_a_use_is_inserted_after_a_value(write: Write) -> None:
    change = "{insert: third, group: pass, in: {height: pass_2}, after: pass_2.height}"
    graph = patched(write, change)
    assert graph.nodes["third.slope"].inputs["height"] == "pass_2.raw"
    assert graph.nodes["both.one.slope"].inputs["height"] == "third.raw"
    assert graph.outputs == {"height": "third.raw"}


def test_a_variant_may_define_groups(write: Write) -> None:
    more = "groups: {calm: {inputs: {height: {}}, nodes: {n: {op: noted, in: {image: height}}}}}\n"
    graph = patched(write, "{insert: c, group: calm, in: {height: pass_1}}", more=more)
    assert graph.nodes["c.n"].inputs == {"image": "pass_1.raw"}
    change = "{remove: save}"
    message = refusal(write, change, more=more.replace("calm", "pass"))
    assert "groups.pass: there is a group 'pass' already; 'patch' changes it" in message
    message = refusal(write, change, more=more.replace("calm", "pass_1"))
    assert "groups.pass_1: a node is called 'pass_1' too" in message


def test_a_program_can_make_the_same_changes_as_a_file(write: Write) -> None:
    graph = read_graph(write(PASSES))
    changes = {"pass.steepest": 8.0, "pass_1.steepest": 7.0, "both.two.slope.steepest": 6.0}
    slopes = steepest(with_changes(graph, changes))
    assert slopes == {"pass_1": 7.0, "pass_2": 8.0, "both.one": 8.0, "both.two": 6.0}


def test_a_param_that_reaches_no_node_any_more_is_refused(write: Write) -> None:
    graph = read_graph(write(PASSES))
    with pytest.raises(GraphError, match="no node of the group 'pass' takes the param 'steepest'"):
        with_changes(graph, {"pass.slope.steepest": 8.0, "pass_1.steepest": 7.0})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("{set: pass_3.slope, with: {steepest: 1}}", "there is no node 'pass_3.slope'; did you"),
        ("{set: pass.slop, with: {n: 1}}", "the group 'pass' has no node 'slop'; did you mean"),
        ("{set: pass_1, with: {n: 1}}", "with.n: set: the group 'pass' has no param 'n' (it takes"),
        ("{set: pass, with: {n: 1}}", "with.n: set: the group 'pass' has no param 'n' (it takes"),
        ("{remove: pass}", "remove: 'pass' is a group; name one of its nodes"),
        ("{neutral: pass_1}", "neutral: 'pass_1' is a use of a group; name one of its nodes"),
        ("{replace: pass, op: sum}", "replace: 'pass' is a group; name one of its nodes"),
        ("{replace: save}", "replace needs 'op' or 'group'"),
        ("{insert: pass, op: sum}", "insert: there is a group 'pass' already"),
        ("{insert: pass_1, op: sum}", "insert: there is a node 'pass_1' already"),
        ("{insert: pass_3.sum, op: sum}", "there is no group, and no use of one, 'pass_3'"),
        ("{insert: pass.raw, op: sum}", "insert: the group 'pass' has 'raw' already"),
        ("{insert: pass.pixel, op: sum}", "insert: the group 'pass' has 'pixel' already"),
        ("{insert: pass.p, group: pair}", "the group 'pair' needs the input 'height'"),
        (
            "{insert: pass.p, group: pair, in: {height: raw}}",
            "group: a group cannot use itself: pair -> pass -> pair",
        ),
        ("{insert: pass.p, group: pas}", "there is no group 'pas'; did you mean 'pass'?"),
        ("{set: pair.one, with: {steepest: 1}}", "'one' uses the group 'pass'; change that one"),
        ("{insert: pass.n, op: sum, after: height}", "'height' is an input of the group 'pass'"),
        ("{insert: p, group: pass}", "the group 'pass' needs the input 'height'"),
        ("{insert: p, group: pas}", "there is no group 'pas'; did you mean 'pass'?"),
        ("{insert: p, op: sum, after: pass_2.slop}", "no output or node 'slop'; did you mean"),
    ],
)
def test_an_impossible_change_is_refused(write: Write, change: str, message: str) -> None:
    assert message in refusal(write, change)
