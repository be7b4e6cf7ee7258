"""Iteration: a repeated group means the same as one use of the group for each turn."""

from typing import Any

import pytest

from tactograph.graph import GraphError, load
from tactograph.graph.files.apply_patch import apply_patch
from tactograph.graph.files.changes import with_changes
from tactograph.graph.files.groups import meant_nodes
from tactograph.graph.files.read_graph import read_graph
from tests.graph.conftest import Write

REPEATED = """
format: 1
params:
  file: {kind: path}
  steepest: {kind: number, default: 3.0}
groups:
  round:
    inputs:
      height: {help: the height before}
      truth:  {default: null}
      pixel:  {default: size}
    params:
      steepest: {default: $steepest}
    nodes:
      slope: {op: height_slopes, in: {height: height, pixel: pixel}, with: {steepest: $steepest}}
      raw:   {op: integrate_dct, in: {slope: slope.slope, pixel: pixel}}
      score: {op: evaluate_height, in: {height: raw, pixel: pixel, truth: truth}}
    outputs: {height: raw, mask: slope.mask}
nodes:
  start: {op: read_height, with: {file: $file}}
  size:  {op: pixel_size, with: {mm: 0.1}}
  rough:
    group: round
    in: {height: start}
    repeat: [{}, {steepest: 5.0}, {steepest: $steepest}]
    carry: {height: height, truth: score}
outputs: {height: rough.height, mask: rough.slope.mask, first: rough.1.score}
"""
TURNS = """
  rough_1: {group: round, in: {height: start}}
  rough_2: {group: round, in: {height: rough_1.height, truth: rough_1.score}, with: {steepest: 5.0}}
  rough_3: {group: round, in: {height: rough_2.height, truth: rough_2.score}}
outputs: {height: rough_3.height, mask: rough_3.slope.mask, first: rough_1.score}
"""
BY_HAND = REPEATED.partition("\n  rough:")[0] + TURNS


def iterated(**changed: Any) -> dict[str, Any]:
    """A graph that doubles light turn by turn, parts of its use changed."""
    group = {
        "inputs": {"light": {}},
        "params": {"n": {"default": 1}},
        "nodes": {"twice": {"op": "doubled", "in": {"image": "light"}, "with": {"n": "$n"}}},
        "outputs": {"light": "twice"},
    }
    use = {"group": "more", "in": {"light": "frames.image"}, "repeat": 3}
    use |= {"carry": {"light": "light"}, **changed.pop("use", {})}
    nodes = {"frames": {"op": "touches"}, "use": {k: v for k, v in use.items() if v is not None}}
    return {"format": 1, "groups": {"more": group}, "nodes": nodes} | (
        changed or {"outputs": {"light": "use.light"}}
    )


def test_a_repeated_group_equals_one_use_for_each_turn(write: Write) -> None:
    repeated, by_hand = read_graph(write(REPEATED)), read_graph(write(BY_HAND))

    def renamed(text: str) -> str:
        return text.replace("rough_", "rough.")

    assert list(repeated.nodes) == [renamed(name) for name in by_hand.nodes]
    for name, entry in by_hand.nodes.items():
        inputs = {port: renamed(reference) for port, reference in entry.inputs.items()}
        assert repeated.nodes[renamed(name)].inputs == inputs
        assert repeated.nodes[renamed(name)].settings == entry.settings
    assert repeated.outputs == {name: renamed(r) for name, r in by_hand.outputs.items()}


def test_turns_run_and_each_has_a_name(toys: list[str]) -> None:
    graph = iterated(outputs={"light": "use", "first": "use.1", "second": "use.2.twice"})
    del graph["groups"]["more"]["params"], graph["groups"]["more"]["nodes"]["twice"]["with"]
    result = next(iter(load(graph).items()))
    assert [result[name].max() for name in ("first", "second", "light")] == [2, 4, 8]


def test_a_change_applies_to_one_turn_to_all_or_to_the_group() -> None:
    graph = read_graph(iterated())

    def counts(target: str) -> list[int]:
        changed = with_changes(graph, {target: 7})
        return [changed.nodes[f"use.{turn}.twice"].settings["n"] for turn in (1, 2, 3)]

    assert counts("use.2.n") == counts("use.2.twice.n") == [1, 7, 1]
    assert counts("use.n") == counts("more.n") == counts("more.twice.n") == [7, 7, 7]
    assert meant_nodes(graph, "use.2") == ["use.2.twice"]
    assert meant_nodes(graph, "use") == ["use.1.twice", "use.2.twice", "use.3.twice"]


def test_a_change_repeats_a_group_or_replaces_it_by_a_node(toys: list[str]) -> None:
    graph = read_graph(iterated(outputs={"light": "use.light"}))
    places = read_graph(iterated()).uses["use"].places
    carry, reads = {"light": "light"}, {"light": "frames.image"}
    repeated_use = {"group": "more", "inputs": reads, "repeat": [{}, {"n": 2}], "carry": carry}
    graph = apply_patch(graph, {"replace": "use", **repeated_use}, places)
    assert list(graph.nodes) == ["frames", "use.1.twice", "use.2.twice"]
    assert graph.nodes["use.2.twice"].settings == {"n": 2}
    graph = apply_patch(graph, {"replace": "use", "op": "doubled", "inputs": {}}, places)
    assert list(graph.nodes) == ["frames", "use"]
    assert graph.outputs == {"light": "use.light"}


@pytest.mark.parametrize(
    ("use", "message"),
    [
        ({"repeat": 0}, "nodes.use.repeat: from 1 to 100 turns are needed, not 0"),
        ({"repeat": 10**9}, "nodes.use.repeat: from 1 to 100 turns are needed, not 1000000000"),
        ({"repeat": []}, "nodes.use.repeat: at least one is needed, not []"),
        ({"repeat": "often"}, "nodes.use.repeat: a list is needed, not 'often'"),
        ({"repeat": [{}, 2]}, "nodes.use.repeat[1]: a mapping is needed, not 2"),
        ({"repeat": [{}, {"m": 2}]}, "nodes.use.repeat[1].m: the group 'more' has no param 'm'"),
        ({"repeat": [{"n": "$m"}]}, "nodes.use.repeat[0].n): the graph has no param"),
        ({"repeat": None}, "nodes.use.carry: 'carry' needs 'repeat'"),
        ({"carry": None}, "nodes.use.repeat: 'repeat' needs 'carry'"),
        ({"carry": {"lihgt": "light"}}, "nodes.use.carry.lihgt: the group 'more' has no input"),
        ({"carry": {"light": "lihgt"}}, "nodes.use.carry.light: the group 'more' has no output or"),
        ({"in": {}}, "nodes.use.in: the group 'more' needs the input 'light'"),
        ({"group": "moor"}, "nodes.use.group: there is no group 'moor'; did you mean 'more'?"),
    ],
)
def test_a_mistake_is_reported_with_its_place(
    use: dict[str, Any], message: str, toys: list[str]
) -> None:
    with pytest.raises(GraphError) as caught:
        load(iterated(use=use))
    assert message in str(caught.value)


def test_only_a_group_is_repeated() -> None:
    patch = [{"replace": "use", "op": "doubled", "repeat": 2}]
    graph = {"format": 1, "extends": "paper", "patch": [{**patch[0], "replace": "light"}]}
    with pytest.raises(GraphError, match=r"patch\[0\].repeat: only a group has 'repeat'"):
        read_graph(graph)
