"""Groups: a graph with groups means the same as the graph written without them."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tactograph.graph import GraphError, load
from tactograph.graph.files.read_graph import read_graph
from tests.graph.conftest import Write

TWICE = """
format: 1
title: Slopes and back, twice
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
  start:  {op: read_height, with: {file: $file}}
  size:   {op: pixel_size, with: {mm: 0.1}}
  first:  {group: round, in: {height: start}}
  second: {group: round, in: {height: first.height, truth: start}, with: {steepest: 5.0}}
outputs: {height: second.height, mask: second.slope.mask, score: second.score, first: first.score}
"""
FLAT = """
format: 1
title: The same by hand
params:
  file: {kind: path}
  steepest: {kind: number, default: 3.0}
nodes:
  start: {op: read_height, with: {file: $file}}
  size:  {op: pixel_size, with: {mm: 0.1}}
  first.slope: {op: height_slopes, in: {height: start, pixel: size}, with: {steepest: $steepest}}
  first.raw:   {op: integrate_dct, in: {slope: first.slope.slope, pixel: size}}
  first.score: {op: evaluate_height, in: {height: first.raw, pixel: size}}
  second.slope: {op: height_slopes, in: {height: first.raw, pixel: size}, with: {steepest: 5.0}}
  second.raw:   {op: integrate_dct, in: {slope: second.slope.slope, pixel: size}}
  second.score: {op: evaluate_height, in: {height: second.raw, pixel: size, truth: start}}
outputs: {height: second.raw, mask: second.slope.mask, score: second.score, first: first.score}
"""


def with_group(**changed: Any) -> dict[str, Any]:
    """A graph of one group and one use, parts of it changed."""
    group = {
        "inputs": {"light": {}},
        "nodes": {"twice": {"op": "doubled", "in": {"image": "light"}}},
        "outputs": {"light": "twice"},
    }
    graph = {
        "format": 1,
        "groups": {"more": {**group, **changed.pop("more", {})}, **changed.pop("groups", {})},
        "nodes": {
            "frames": {"op": "touches"},
            "use": {"group": "more", "in": {"light": "frames.image"}, **changed.pop("use", {})},
            **changed.pop("nodes", {}),
        },
        "outputs": {"light": "use.light"},
    }
    return {**graph, **changed}


def test_a_graph_with_groups_is_the_one_written_by_hand(write: Write) -> None:
    grouped, flat = read_graph(write(TWICE)), read_graph(write(FLAT))
    assert (grouped.nodes, grouped.outputs) == (flat.nodes, flat.outputs)
    assert grouped.hash == flat.hash
    assert list(grouped.nodes) == list(flat.nodes)


NAMES = st.sampled_from(["a", "b", "c", "d", "e"])


@st.composite
def groups(draw: st.DrawFn) -> tuple[dict[str, Any], dict[str, Any]]:
    """A group used several times, and the same nodes written by hand."""
    inside = draw(st.lists(NAMES, min_size=1, max_size=4, unique=True))
    wanted = draw(st.lists(st.sampled_from(["p", "q"]), min_size=1, max_size=2, unique=True))
    reads: dict[str, dict[str, str]] = {}
    for at, node in enumerate(inside):
        known = [*wanted, *inside[:at]]
        reads[node] = draw(st.dictionaries(NAMES, st.sampled_from(known), max_size=3))
        reads[node] |= {f"at_{name}": name for name in wanted} if at == 0 else {}
    output = draw(st.sampled_from(inside))
    param = draw(st.integers(0, 9))
    group = {
        "inputs": {name: {"default": None} for name in wanted},
        "params": {"n": {"default": param}},
        "nodes": {n: {"op": "toy", "in": r, "with": {"n": "$n"}} for n, r in reads.items()},
        "outputs": {"out": output},
    }
    grouped: dict[str, Any] = {"source": {"op": "toy"}}
    flat: dict[str, Any] = {"source": {"op": "toy"}}
    before, before_flat = ["source"], {"source": "source"}
    for use in draw(st.lists(st.sampled_from(["u", "v", "w"]), min_size=1, unique=True)):
        bound = draw(st.dictionaries(st.sampled_from(wanted), st.sampled_from(before)))
        chosen_n = draw(st.none() | st.integers(0, 9))
        grouped[use] = {"group": "g", "in": bound}
        if chosen_n is not None:
            grouped[use]["with"] = {"n": chosen_n}
        for node, ports in reads.items():
            names = {port: bound.get(r, "") if r in wanted else r for port, r in ports.items()}
            flat[f"{use}.{node}"] = {
                "op": "toy",
                "in": {
                    port: before_flat[name] if ports[port] in wanted else f"{use}.{name}"
                    for port, name in names.items()
                    if name
                },
                "with": {"n": param if chosen_n is None else chosen_n},
            }
        before += [f"{use}.out", *(f"{use}.{node}" for node in inside)]
        before_flat |= {f"{use}.{node}": f"{use}.{node}" for node in inside}
        before_flat[f"{use}.out"] = f"{use}.{output}"
    last = draw(st.sampled_from(before))
    return (
        {"format": 1, "groups": {"g": group}, "nodes": grouped, "outputs": {"last": last}},
        {"format": 1, "nodes": flat, "outputs": {"last": before_flat[last]}},
    )


@settings(max_examples=60)
@given(groups())
def test_any_graph_with_a_group_is_the_one_written_by_hand(
    pair: tuple[dict[str, Any], dict[str, Any]],
) -> None:
    grouped, flat = map(read_graph, pair)
    assert (grouped.nodes, grouped.outputs) == (flat.nodes, flat.outputs)


def test_a_group_may_use_another() -> None:
    both = {
        "inputs": {"light": {}, "level": {"default": None}},
        "params": {"n": {}},
        "nodes": {
            "one": {"group": "more", "in": {"light": "light"}},
            "two": {"op": "flat_field", "in": {"image": "one.light", "dark": "level.dark"}},
            "three": {"group": "more", "in": {"light": "two"}},
            "four": {"op": "doubled", "in": {"image": "three.twice"}, "with": {"n": "$n"}},
        },
        "outputs": {"light": "three"},
    }
    use = {"group": "both", "in": {"light": "frames.image", "level": "cal"}, "with": {"n": 2}}
    nodes = {"cal": {"op": "at_rest"}, "pair": use}
    graph = read_graph(
        with_group(groups={"both": both}, nodes=nodes, outputs={"light": "pair.light"})
    )
    inputs = {name: entry.inputs for name, entry in graph.nodes.items() if "pair" in name}
    assert inputs == {
        "pair.one.twice": {"image": "frames.image"},
        "pair.two": {"image": "pair.one.twice", "dark": "cal.dark"},
        "pair.three.twice": {"image": "pair.two"},
        "pair.four": {"image": "pair.three.twice"},
    }
    assert graph.outputs == {"light": "pair.three.twice"}


def test_values_of_the_previous_item_pass_through_inputs_and_outputs() -> None:
    more = {
        "inputs": {"light": {}, "before": {"default": None}},
        "nodes": {
            "one": {"op": "blended", "in": {"image": "light", "before": "before"}},
            "two": {"op": "blended", "in": {"image": "one", "before": "previous.one"}},
        },
    }
    use = {"in": {"light": "frames.image", "before": "previous.use.two"}}
    graph = read_graph(with_group(more=more | {"outputs": {"light": "two"}}, use=use))
    assert graph.nodes["use.one"].inputs == {"image": "frames.image", "before": "previous.use.two"}
    assert graph.nodes["use.two"].inputs == {"image": "use.one", "before": "previous.use.one"}


def test_groups_run(toys: list[str]) -> None:
    nodes = {
        "frames": {"op": "touches", "with": {"count": "$count"}},
        "again": {"group": "more", "in": {"light": "use"}},
    }
    outputs = {"once": "use.light", "twice": "again"}
    count = {"count": {"kind": "integer"}}
    pipeline = load(with_group(nodes=nodes, outputs=outputs, params=count))
    stack = np.ones((3, 4, 5), np.float32)
    pipeline(frames=stack)
    pipeline.set("use.twice")  # from now on it caches the results of its nodes
    result = pipeline(frames=stack)
    np.testing.assert_array_equal(result["once"], 2 * stack)
    np.testing.assert_array_equal(result["twice"], 4 * stack)
    assert "again.twice" in result.times
    for reference in ("again", "again.light", "again.twice", "again.twice.doubled"):
        np.testing.assert_array_equal(pipeline.inspect(reference), 4 * stack)


USE = "nodes.use"
DEFINED = "groups.more"


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        (with_group(use={"group": "moor"}),
         f"{USE}.group: there is no group 'moor'; did you mean 'more'?"),
        (with_group(use={"in": {"lihgt": "frames.image"}}),
         f"{USE}.in.lihgt: the group 'more' has no input 'lihgt'; did you mean 'light'?"),
        (with_group(use={"in": {}}), f"{USE}.in: the group 'more' needs the input 'light'"),
        (with_group(use={"with": {"n": 2}}),
         f"{USE}.with.n: the group 'more' has no param 'n' (it takes: none)"),
        (
            with_group(
                more={
                    "params": {"n": {}},
                    "nodes": {"twice": {"op": "doubled", "in": {"image": "light"}}}
                    | {"other": {"op": "touches", "with": {"count": "$n"}}},
                }
            ),
            f"{USE}: the group 'more' needs the param 'n'",
        ),
        (with_group(use={"op": "doubled"}), f"{USE}.op: a node with 'group' has no 'op'"),
        (with_group(use={"backend": "numpy"}), f"{USE}.backend: a node with 'group' has no"),
        (with_group(use={"wiht": {}}), f"{USE}.wiht: unknown key 'wiht'; did you mean 'with'?"),
        (with_group(more={"outputs": {"light": "once"}}),
         f"{DEFINED}.outputs.light: the group 'more' has no node 'once'"),
        (with_group(more={"outputs": {"light": "light"}}),
         f"{DEFINED}.outputs.light: 'light' is an input; read it where it comes from"),
        (with_group(more={"inputs": {"light": {}, "dark": {}}}),
         f"{DEFINED}.inputs.dark: no node of the group 'more' reads the input 'dark'"),
        (with_group(more={"inputs": {"light": {}, "twice": {}}}),
         f"{DEFINED}.inputs.twice: a node of the group 'more' is called 'twice' too"),
        (with_group(more={"params": {"n": {"default": 1}}}),
         f"{DEFINED}.params.n: no node of the group 'more' takes the param '$n'"),
        (with_group(more={"nodes": {}}), f"{DEFINED}.nodes: at least one is needed"),
        (with_group(more={"outputs": {"light": 5}}),
         f"{DEFINED}.outputs.light: text is needed, not 5"),
        (with_group(groups={"less": 5}), "groups.less: a mapping is needed, not 5"),
        (with_group(more={"input": {}}), f"{DEFINED}.input: unknown key 'input'; did you mean"),
        (with_group(more={"inputs": {"light": {"defualt": "frames"}}}),
         f"{DEFINED}.inputs.light.defualt: unknown key 'defualt'; did you mean 'default'?"),
        (with_group(nodes={"more": {"op": "touches"}}),
         f"{DEFINED}: a node is called 'more' too; give another name"),
        (with_group(nodes={"use.twice": {"op": "touches"}}),
         "nodes.use.twice: 'use' is a node; none can be in it"),
        (with_group(outputs={"light": "use.lihgt"}),
         "outputs.light: the group 'more' has no output or node 'lihgt'; did you mean 'light'?"),
        (with_group(more={"outputs": {}}, outputs={"light": "use"}),
         "outputs.light: 'use' uses the group 'more'; say which output: none"),
    ],
)  # fmt: skip
def test_a_mistake_is_reported_with_its_place(mistake: dict[str, Any], message: str) -> None:
    with pytest.raises(GraphError) as caught:
        read_graph(mistake)
    assert message in str(caught.value)


def test_a_group_cannot_use_itself() -> None:
    loop = {"nodes": {"twice": {"group": "more", "in": {"light": "light"}}}}
    with pytest.raises(GraphError, match="a group cannot use itself: more -> more"):
        read_graph(with_group(more=loop))
    other = {"more": {"nodes": {"a": {"group": "b"}}}, "b": {"nodes": {"c": {"group": "more"}}}}
    graph = {"format": 1, "groups": other, "nodes": {"use": {"group": "more"}}}
    with pytest.raises(GraphError, match="a group cannot use itself: more -> b -> more"):
        read_graph(graph)


def nested(depth: int, times: int) -> dict[str, Any]:
    """A graph of nested groups, each of which uses the one before ``times`` times."""
    inputs = {"light": {}}
    twice = {"op": "doubled", "in": {"image": "light"}}
    groups: dict[str, Any] = {"g1": {"inputs": inputs, "nodes": {"twice": twice}}}
    for n in range(2, depth + 1):
        use = {"group": f"g{n - 1}", "in": {"light": "light"}}
        groups[f"g{n}"] = {"inputs": inputs, "nodes": {f"u{k}": use for k in range(times)}}
    use = {"group": f"g{depth}", "in": {"light": "frames"}}
    return {"format": 1, "groups": groups, "nodes": {"frames": {"op": "touches"}, "use": use}}


@pytest.mark.parametrize("depth", [14, 49])
def test_a_small_file_cannot_expand_to_a_huge_graph(depth: int) -> None:
    message = r"groups.g\d+.nodes.u1.group: with 'g\d+' there are more than 10000 nodes and uses"
    with pytest.raises(GraphError, match=message):
        read_graph(nested(depth, times=2))


def test_groups_nest_at_most_50_deep() -> None:
    assert len(read_graph(nested(50, times=1)).nodes) == 2
    with pytest.raises(
        GraphError, match=r"groups.g151.nodes.u0.group: groups are nested more than 50 deep"
    ):
        read_graph(nested(200, times=1))


@pytest.mark.parametrize(
    ("old", "new", "place", "used_by", "message"),
    [
        ("pixel: pixel, truth", "pixle: pixel, truth", "18:54", "23:3", "no input 'pixle'"),
        ("slope: slope.slope", "slope: slop.slope", "17:39", "23:3", "no node or input 'slop'"),
        ("{height: start}", "{height: strat}", "16:39", "23:31", "there is no node 'strat'"),
        ("steepest: 5.0", "steepest: -5", "16:77", "24:75", "greater than 0, not -5"),
        ("default: size", "default: sise", "16:55", "23:3", "there is no node 'sise'"),
    ],
)
def test_a_mistake_in_a_group_is_reported_with_its_place_and_that_of_the_use(
    write: Write, old: str, new: str, place: str, used_by: str, message: str
) -> None:
    assert TWICE.count(old) == 1
    file = write(TWICE.replace(old, new))
    with pytest.raises(GraphError) as caught:
        load(file, file="height.npy")
    error = str(caught.value)
    assert error.startswith(f"{file}:{place}: groups.round.nodes.")
    assert f"(used by {file}:{used_by}: nodes." in error
    assert message in error
