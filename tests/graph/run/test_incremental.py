"""Only what changed is computed, and the result is that of a fresh run."""

import gc

import numpy as np
import pytest

from tactograph.graph import InputError, NodeError, load
from tactograph.graph.cache.cache import Cache
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tests.fixtures import Calibration, Raytraced
from tests.graph.conftest import STREAM, Write, graph_of

pytestmark = [
    pytest.mark.usefixtures("toys"),
    pytest.mark.filterwarnings("ignore:a warning"),
]

CHAIN = """
format: 1
params: {count: {kind: integer}}
nodes:
  frames: {op: touches, with: {count: $count}}
  cal:    {op: at_rest}
  light:  {op: flat_field, in: {image: frames.image, flat: cal.flat, dark: cal.dark}}
  twice:  {op: doubled, in: {image: light}}
  copy:   {op: noticed, in: {image: twice}}
  high:   {op: bright, in: {image: light}}
  sum:    {op: summed, in: {image: copy, before: previous.sum}}
  save:   {op: noted, in: {image: sum}}
outputs: {light: light, copy: copy, high: high.light, sum: sum}
"""
STACK = np.full((3, 4, 5), 0.5, np.float32)


def test_a_second_call_with_equal_arrays_computes_nothing(toys: list[str], backend: str) -> None:
    pipeline = load(
        graph_of(CHAIN.replace("before: previous.sum", "")), backend=backend, cache=Cache()
    )
    first = pipeline(frames=STACK)
    second = pipeline(frames=STACK.copy())
    assert toys == ["at_rest", "doubled"]
    assert {"light", "twice", "copy"} <= second.reused
    assert not {"light", "twice", "copy"} & first.reused
    for name in first:
        np.testing.assert_array_equal(first[name], second[name])
    assert second.warnings == first.warnings == ["a warning"]


def test_a_change_recomputes_only_what_depends_on_it(toys: list[str], backend: str) -> None:
    pipeline = load(graph_of(CHAIN), backend=backend, cache=Cache())
    pipeline(frames=STACK)
    pipeline.set("high", above=0.25)
    result = pipeline.again()
    names = {name for name in pipeline.plan.tasks if name != "save"}
    assert names - result.reused == {"high"}
    assert names - pipeline.again().reused == set()
    assert toys.count("doubled") == 1
    fresh = load(graph_of(CHAIN), backend=backend, changes={"high.above": 0.25})(frames=STACK)
    for name in fresh:
        np.testing.assert_array_equal(result[name], fresh[name])


def test_refilled_arrays_do_not_change_cached_values(backend: str) -> None:
    text = CHAIN.replace("op: doubled", "op: passed_on")
    pipeline = load(graph_of(text), backend=backend, cache=Cache())
    stack = STACK.copy()
    pipeline(frames=stack)
    stack[:] = 7
    np.testing.assert_array_equal(pipeline.again()["copy"], STACK)
    np.testing.assert_array_equal(pipeline.inspect("frames.image"), STACK)


def test_the_previous_item_is_that_of_the_stream_even_if_an_item_is_repeated(backend: str) -> None:
    def sums(cache: Cache | None) -> list[float]:
        graph = graph_of(CHAIN)
        pipeline = open_pipeline(graph, {"count": 3}, backend=backend, cache=cache)
        totals = []
        for item in pipeline.items():
            for _ in range(2 if cache else 0):
                item = pipeline.again()
            totals.append(float(item["sum"][0, 0, 0]))
        return totals

    assert sums(Cache()) == sums(None)


def test_an_ended_or_closed_stream_can_be_inspected_and_restarted(backend: str) -> None:
    pipeline = load(graph_of(CHAIN), {"count": 3}, backend=backend, cache=Cache())
    results = list(pipeline.items())
    assert pipeline.inspect("sum").max() == pipeline.again()["sum"].max() == 12
    assert pipeline.inspect("frames.name") == "touch3"
    for one, other in zip(results, pipeline.items(), strict=True):
        np.testing.assert_array_equal(one["sum"], other["sum"])
    stream = pipeline.items()
    last = [next(stream), next(stream)][1]
    stream.close()
    np.testing.assert_array_equal(pipeline.inspect("sum"), last["sum"])


@pytest.mark.parametrize("how", ["set", "aim"])
def test_an_item_of_a_source_is_unavailable_after_its_settings_change(how: str) -> None:
    pipeline = load(graph_of(CHAIN), {"count": 3}, backend="numpy", cache=Cache())
    list(pipeline.items())
    if how == "set":
        pipeline.set("frames", rows=4)
    else:
        pipeline.aim(count=2)
    for look in (pipeline.again, lambda: pipeline.inspect("twice")):
        with pytest.raises(InputError, match=r"settings of 'frames' changed .* items\(\)"):
            look()
    last = list(pipeline.items())[-1]["copy"]
    np.testing.assert_array_equal(pipeline.inspect("twice"), last)


def test_a_cache_too_small_for_anything_changes_no_result(backend: str) -> None:
    small = Cache(megabytes=1e-4)
    pipeline = load(graph_of(CHAIN), backend=backend, cache=small)
    fresh = load(graph_of(CHAIN), backend=backend)
    for level in (0.5, 0.25, 0.5):
        result, expected = pipeline(frames=level * STACK), fresh(frames=level * STACK)
        for name in expected:
            np.testing.assert_array_equal(result[name], expected[name])
        assert small.bytes <= small.most
    np.testing.assert_array_equal(pipeline.inspect("twice"), expected["copy"])


def test_a_size_that_depends_on_the_data_does_not_rerun_nodes_outside_the_stream(
    backend: str,
) -> None:
    text = CHAIN.replace("  high: ", "  rest: {op: bright, in: {image: cal.flat}}\n  high: ")
    text = text.replace("outputs: {", "outputs: {rest: rest.light, ")
    pipeline = load(graph_of(text), backend=backend, cache=Cache())
    pipeline(frames=STACK)
    pipeline.set("high", above=0.25)
    assert "rest" in pipeline.again().reused
    assert "rest" in pipeline(frames=2 * STACK).reused


def test_two_pipelines_share_equal_results(toys: list[str], write: Write) -> None:
    cache = Cache()
    other = CHAIN.replace("{op: bright, in: {image: light}}", "{op: bright, in: {image: twice}}")
    for name, text in (("one.yaml", CHAIN), ("two.yaml", other)):
        load(write(text, name), backend="opencl", cache=cache)(frames=STACK)
    assert toys.count("doubled") == 1


def test_results_of_device_and_host_do_not_replace_each_other() -> None:
    cache = Cache()
    for backend in ("numpy", "opencl"):
        result = load(graph_of(CHAIN), backend=backend, cache=cache)(frames=STACK)
        assert "light" not in result.reused


def test_a_failed_run_leaves_no_result_behind() -> None:
    text = CHAIN.replace("{op: noticed, in: {image: twice}}", "{op: failing, in: {image: twice}}")
    pipeline = load(graph_of(text), backend="opencl", cache=Cache(), changes={"copy.at": 1.0})
    with pytest.raises(NodeError):
        pipeline(frames=STACK)
    pipeline.set("copy", at=9.0)
    np.testing.assert_array_equal(pipeline(frames=STACK)["light"], STACK)


def test_sinks_write_again_even_if_nothing_is_computed(toys: list[str], backend: str) -> None:
    graph = graph_of(STREAM)
    pipeline = open_pipeline(graph, {"count": 1}, backend=backend, cache=Cache())
    (item,) = pipeline.items()
    pipeline = open_pipeline(graph, {"count": 1}, backend=backend, cache=Cache())
    next(pipeline.items())
    pipeline.again()
    assert toys.count("noted 1") == 3
    assert item["score"] == {"mean": 1.0, "truth": 1.0}


def test_repeats_run_only_what_is_not_cached(toys: list[str], backend: str) -> None:
    graph = graph_of(CHAIN)
    cache = Cache()
    for _ in range(2):
        pipeline = open_pipeline(graph, {"count": 2}, backend=backend, cache=cache)
        results = list(pipeline.items(repeats=3))
    assert toys.count("doubled") == 6
    assert all(result.times["twice"] > 0 for result in results)


def test_an_inner_value_can_be_inspected(toys: list[str], backend: str) -> None:
    text = CHAIN.replace(
        "outputs: {", "  half: {op: halves, in: {image: light}}\noutputs: {half: half.low, "
    )
    pipeline = load(graph_of(text), backend=backend, cache=Cache())
    pipeline(frames=STACK)
    np.testing.assert_array_equal(pipeline.inspect("twice"), 2 * STACK)
    unread = pipeline.inspect("half.high")
    assert unread.shape == STACK.shape
    with pytest.raises(ValueError, match="read-only"):
        unread[0] = 1
    assert toys.count("doubled") == 1


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("ligth", "no node 'ligth' is run; did you mean 'light'"),
        ("cal", r"node 'cal' has several outputs; name one of cal\.flat, cal\.dark"),
        ("light.height", r"node .light. has no output .height.; it has flat_field"),
    ],
)
def test_an_unknown_value_is_reported(reference: str, message: str) -> None:
    pipeline = load(graph_of(CHAIN), backend="numpy", cache=Cache())
    pipeline(frames=STACK)
    with pytest.raises(InputError, match=message):
        pipeline.inspect(reference)


def test_inspect_and_again_need_an_item() -> None:
    pipeline = load(graph_of(CHAIN), backend="numpy")
    pipeline(frames=STACK)
    with pytest.raises(InputError, match="no item has cached results; run one now"):
        pipeline.inspect("light")
    pipeline(frames=STACK)
    np.testing.assert_array_equal(pipeline.inspect("light"), STACK)
    other = load(graph_of(CHAIN), backend="numpy")
    other(frames=STACK)
    with pytest.raises(InputError, match="no item has cached results; run one now"):
        other.again()
    other(frames=STACK)
    assert "light" in other.again().reused


@pytest.mark.parametrize("outputs", [None, ["copy"]], ids=["all", "without that node"])
def test_a_wrong_setting_changes_nothing(outputs: list[str] | None) -> None:
    pipeline = load(graph_of(CHAIN), backend="numpy", outputs=outputs)
    before = pipeline.plan.graph.hash
    for node, settings, message in (
        (3, {"above": 1}, "set: 3 is not a node's name"),
        ("hihg", {"above": 1}, "there is no node 'hihg'; did you mean 'high'"),
        ("high", {"abov": 1}, "has no parameter 'abov'; did you mean 'above'"),
        ("high", {"above": "much"}, "a number is needed, not 'much'"),
    ):
        with pytest.raises(InputError, match=message):
            pipeline.set(node, **settings)  # type: ignore[arg-type]
    assert pipeline.plan.graph.hash == before
    pipeline.set("high", above=2)
    assert pipeline.plan.graph.hash != before


def test_after_a_change_only_the_requested_outputs_are_computed(
    toys: list[str], backend: str
) -> None:
    text = CHAIN.replace("before: previous.sum", "")
    pipeline = load(graph_of(text), backend=backend, cache=Cache())
    pipeline(frames=STACK)
    toys.clear()
    pipeline.set("light", floor=0.5)
    assert pipeline.again(["high"])["high"].size == 0
    assert "doubled" not in toys
    np.testing.assert_array_equal(pipeline.inspect("twice"), 2 * STACK)
    assert toys.count("doubled") == 1
    result = pipeline.again()
    assert toys.count("doubled") == 1
    np.testing.assert_array_equal(result["copy"], pipeline.inspect("copy"))
    pipeline.set("light", floor=0.4)
    pipeline.again(["high"])
    result = pipeline(frames=2 * STACK)
    np.testing.assert_array_equal(result["light"], 2 * STACK)


def test_a_group_is_set_in_one_use_or_in_all() -> None:
    cuts = """
groups:
  cut:
    inputs:  {image: {}}
    params:  {above: {default: 0.0}}
    nodes:   {high: {op: bright, in: {image: image}, with: {above: $above}}}
    outputs: {light: high.light}
nodes:
  one: {group: cut, in: {image: light}}
  two: {group: cut, in: {image: light}}
"""
    text = CHAIN.replace("\nnodes:\n", f"\n{cuts.strip()}\n")
    text = text.replace("\noutputs: {", "\noutputs: {one: one.light, two: two.light, ")
    pipeline = load(graph_of(text), backend="numpy", cache=Cache())

    def lit() -> tuple[int, int]:
        result = pipeline.again(["one", "two"])
        return result["one"].size, result["two"].size

    pipeline(frames=STACK)
    assert lit() == (20, 20)
    pipeline.set("two", above=0.7)
    assert lit() == (20, 0)
    pipeline.set("cut.high", above=0.8)
    assert lit() == (0, 0)
    pipeline.set("one.high", above=0.2)
    assert lit() == (20, 0)
    with pytest.raises(InputError, match="the group 'cut' has no param 'abov'; did you mean"):
        pipeline.set("two", abov=1)


@pytest.mark.slow
def test_reconstruct_follows_its_parameters_as_a_fresh_pipeline_does(
    raytraced: Raytraced, calibration: Calibration
) -> None:
    params = {"capture": str(raytraced / "near33" / "cat"), "calibration": calibration("near33")}
    graph, cache = read_graph("reconstruct"), Cache(megabytes=64)
    pipeline = open_pipeline(graph, params, sinks=False, cache=cache)
    next(pipeline.items())
    for node, settings in (("level", {"degree": 1}), ("rough.2.label", {"steepest": 3.0})):
        pipeline.set(node, **settings)
        result = pipeline.again()
    expected = next(open_pipeline(pipeline.plan.graph, params, sinks=False).items())
    for name in ("height", "slope", "shadow"):
        np.testing.assert_array_equal(result[name], expected[name])
    assert result["metrics"] == expected["metrics"]


def test_three_hundred_changes_take_no_more_memory_than_ten() -> None:
    cache = Cache(megabytes=0.01)
    pipeline = load(graph_of(CHAIN), backend="opencl", cache=cache)
    pipeline(frames=STACK)
    most = 0
    for number in range(300):
        pipeline.set("high", above=number / 300)
        pipeline.again()
        most = max(most, pipeline.buffers)
        if number == 10:
            gc.collect()
            early = pipeline.buffers
    assert cache.bytes <= cache.most
    assert most <= early + 40


def test_a_source_of_files_is_read_for_every_item(toys: list[str]) -> None:
    graph = graph_of(CHAIN)
    pipeline = open_pipeline(graph, {"count": 2}, backend="numpy", cache=Cache())
    for _ in range(2):
        list(pipeline.items())
    assert [word for word in toys if word.startswith("touch")] == ["touch 1", "touch 2"] * 2
    assert toys.count("doubled") == 2


@pytest.mark.parametrize("cached", [False, True], ids=["every step", "only what changed"])
def test_a_failed_item_is_not_the_previous_item(backend: str, cached: bool) -> None:
    text = CHAIN.replace("{op: noticed, in: {image: twice}}", "{op: failing, in: {image: sum}}")
    text = text.replace("{op: summed, in: {image: copy,", "{op: summed, in: {image: light,")
    cache = Cache() if cached else None
    pipeline = load(graph_of(text), backend=backend, cache=cache, changes={"copy.at": 4.0})
    one, three = np.ones((3, 4, 5), np.float32), np.full((3, 4, 5), 3, np.float32)
    for stack, total in ((one, 1), (three, None), (one, 2)):
        if total is None:
            with pytest.raises(NodeError):
                pipeline(frames=stack)
        else:
            np.testing.assert_array_equal(pipeline(frames=stack)["sum"], total * one)
