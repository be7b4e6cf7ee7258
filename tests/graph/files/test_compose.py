"""Graphs that compose: overlays, variants, studies, and groups from files."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from tactograph.graph import GraphError, InputError
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.files.graph_places import shipped
from tactograph.graph.files.read_graph import read_graph, read_graphs, shipped_names, with_overlays
from tactograph.graph.plan.make_plan import make_plan
from tests.graph.conftest import SLOPES, Write

PIPELINES = shipped("graphs")["paper"].parents[1]
DOUBLED = "format: 1\ntitle: doubled\npatch: [{set: pixel, with: {mm: 0.2}}]"
CROPPED = """
format: 1
params: {side: {kind: numbers, default: null}}
patch:
  - {set: height, with: {crop: $side}}
  - {insert: more, op: rest_at_border, in: {height: again}}
outputs: {mask: null, more: more}
"""
VARIANTS = """
variants:
  fine:
    title: At half the size
    patch: [{set: pixel, with: {mm: 0.05}}]
  steep:
    extends: fine
    patch: [{set: slope, with: {steepest: 3}}]
  other:
    base: other.yaml
    patch: [{set: pixel, with: {mm: 7}}]
"""
STUDY = "format: 1\ntitle: What helps\nbase: base.yaml\n" + VARIANTS.partition("  other")[0]
GROUP = """
format: 1
inputs: {height: {help: what is integrated again}, pixel: {default: pixel}}
params: {steepest: {default: 9}}
nodes:
  slope: {op: height_slopes, in: {height: height, pixel: pixel}, with: {steepest: $steepest}}
  raw:   {op: integrate_dct, in: {slope: slope.slope, pixel: pixel}}
outputs: {height: raw}
"""
TWICE = """
format: 1
extends: base.yaml
groups:
  plain: {extends: round.group.yaml}
  other:
    extends: round.group.yaml
    patch:
      - {set: slope, with: {steepest: 4}}
      - {replace: raw, op: integrate_frankot_chellappa}
patch:
  - {insert: one, group: plain, in: {height: height}}
  - {insert: two, group: other, in: {height: one}}
outputs: {height: two.height}
"""


@pytest.fixture(autouse=True)
def _files(write: Write) -> None:
    write(SLOPES, "base.yaml")
    write(SLOPES.replace("back", "back, too"), "other.yaml")
    write(DOUBLED, "doubled.yaml")
    write(CROPPED, "cropped.yaml")
    write(GROUP, "round.group.yaml")


def refusal(file: str) -> str:
    with pytest.raises(GraphError) as caught:
        read_graph(file)
    return str(caught.value)


def mm(graph: Graph) -> object:
    return graph.nodes["pixel"].settings["mm"]


def test_extends_takes_a_graph_and_overlays_in_order(write: Write) -> None:
    graph = read_graph(write("format: 1\nextends: [base.yaml, doubled.yaml, cropped.yaml]"))
    assert mm(graph) == 0.2
    assert graph.nodes["height"].settings["crop"] == "$side"
    assert set(graph.outputs) == {"height", "more"}
    assert not graph.params["side"].required
    write(DOUBLED.replace("0.2", "0.4"), "again.yaml")
    later = read_graph(write("format: 1\nextends: [base.yaml, again.yaml, doubled.yaml]"))
    assert mm(later) == 0.2, "the later overlay wins"


def test_a_change_may_name_one_node_or_several(write: Write) -> None:
    def changed(patch: str) -> Graph:
        return read_graph(write(f"format: 1\nextends: reconstruct\npatch: [{patch}]"))

    one_by_one = changed("{set: label, with: {dark: 0}}, {set: judged, with: {dark: 0}}")
    assert changed("{set: [label, judged], with: {dark: 0}}") == one_by_one
    with pytest.raises(GraphError, match="there is no node 'jugded'; did you mean"):
        changed("{neutral: [shadow, jugded]}")
    with pytest.raises(GraphError, match=r"exactly one of .* set and remove"):
        changed("{set: [label], remove: [label], with: {dark: 0}}")


def test_the_files_own_changes_come_after_its_overlays(write: Write) -> None:
    change = "patch: [{set: pixel, with: {mm: 0.3}}]"
    assert mm(read_graph(write(f"format: 1\nextends: [base.yaml, doubled.yaml]\n{change}"))) == 0.3


def test_an_overlay_extends_overlays(write: Write) -> None:
    write("format: 1\nextends: doubled.yaml\noutputs: {mask: null}", "both.yaml")
    graph = read_graph(write("format: 1\nextends: [base.yaml, both.yaml]"))
    assert mm(graph) == 0.2
    assert set(graph.outputs) == {"height"}


def test_overlays_apply_to_a_graph_that_is_already_read(write: Write, tmp_path: Path) -> None:
    base = read_graph(tmp_path / "base.yaml")
    graph = with_overlays(base, [str(tmp_path / "doubled.yaml")])
    same = read_graph(write("format: 1\nextends: [base.yaml, doubled.yaml]"))
    assert graph.hash == same.hash != base.hash
    assert (graph.name, graph.title) == ("base_doubled", "Height to slopes and back, doubled")


def test_an_overlay_that_does_not_fit_is_reported_in_one_line(write: Write, tmp_path: Path) -> None:
    overlay = write("format: 1\npatch:\n  - {set: pixle, with: {mm: 1}}", "wrong.yaml")
    with pytest.raises(InputError) as caught:
        with_overlays(read_graph(tmp_path / "base.yaml"), [overlay])
    misfit = (
        f"'{overlay}' does not fit base: {overlay}:3:5: patch[0]: set: there is no node 'pixle'; "
        "did you mean 'pixel'?"
    )
    assert str(caught.value) == misfit
    file = write("format: 1\nextends:\n  - base.yaml\n  - wrong.yaml")
    assert refusal(file).startswith(f"{file}:4:5: extends[1]: 'wrong.yaml' does not fit base: ")


def test_an_overlay_that_reads_a_missing_node_does_not_fit(write: Write, tmp_path: Path) -> None:
    node = "{insert: flat, op: rest_at_border, in: {height: raw}}"
    overlay = write(f"format: 1\npatch:\n  - {node}", "wrong.yaml")
    graph = with_overlays(read_graph(tmp_path / "base.yaml"), [overlay])
    with pytest.raises(GraphError, match=r"wrong.yaml:3:45: .*no node 'raw'"):
        make_plan(*to_plan(graph), device=None)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ("[base.yaml, other.yaml]", "other.yaml:6:1: nodes: an overlay has no 'nodes'"),
        (
            "[base.yaml, paper]",
            "4: extends[1]: there is no overlay 'paper'; it is a graph",
        ),
        ("[base.yaml, strem]", "there is no overlay 'strem'; did you mean 'stream'?"),
        ("[base.yaml, nowhere.yaml]", "nowhere.yaml: there is no such graph file"),
        ("[doubled.yaml]", "doubled.yaml:3:1: patch: 'patch' needs 'extends'; this is an overlay"),
        ("stream", "extends: 'stream' is an overlay; lay it over a graph"),
        ("precise_ablation", "extends: 'precise_ablation' is a study; 'tactograph compare prec"),
        ("[]", "extends: at least one is needed, not []"),
        ("{a: b}", "extends: a list is needed, not {'a': 'b'}"),
        ("[base.yaml, 5]", "extends[1]: text is needed, not 5"),
    ],
)
def test_an_unusable_extends_is_reported_with_its_place(
    write: Write, names: str, message: str
) -> None:
    error = refusal(write(f"format: 1\nextends: {names}"))
    assert re.sub(r":2:2\d: extends", ":4: extends", error).find(message) >= 0, error


def test_overlays_and_variants_that_extend_each_other_are_a_loop(write: Write) -> None:
    write("format: 1\nextends: b.yaml", "a.yaml")
    write("format: 1\nextends: a.yaml", "b.yaml")
    message = refusal(write("format: 1\nextends: [base.yaml, a.yaml]"))
    assert "loop: graph.yaml -> a.yaml -> b.yaml -> a.yaml" in message
    for variants, loop in (
        ("a: {extends: b}, b: {extends: a}", "a -> b -> a"),
        ("a: {base: mine.yaml/a}", "a -> a"),
    ):
        file = write(f"{SLOPES}variants: {{{variants}}}", "mine.yaml")
        assert f"'extends' runs in a loop: {loop}" in refusal(f"{file}/a")


def test_a_variant_is_named_after_its_file(write: Write) -> None:
    file = write(SLOPES + VARIANTS, "mine.yaml")
    fine, steep = read_graph(f"{file}/fine"), read_graph(f"{file}/steep")
    assert (fine.name, fine.title, mm(fine)) == ("mine_fine", "At half the size", 0.05)
    assert (steep.name, mm(steep)) == ("mine_steep", 0.05), "it extends the variant above it"
    assert steep.nodes["slope"].settings == {"steepest": 3}
    assert mm(read_graph(file)) == 0.1
    assert mm(read_graph(f"{file}/other")) == 7
    extended = read_graph(write("format: 1\nextends: mine.yaml/fine"))
    assert extended.hash == fine.hash == with_overlays(read_graph(file), ["fine"]).hash


def test_an_unknown_variant_is_refused_with_the_known_ones(write: Write) -> None:
    file = write(SLOPES + VARIANTS, "mine.yaml")
    with pytest.raises(InputError, match="no variant 'fien'; did you mean 'fine'"):
        read_graph(f"{file}/fien")
    with pytest.raises(InputError, match=r"no variant 'x' \(it has: fine, steep, other\)"):
        read_graph(f"{file}/x")


def test_a_graph_has_the_variants_of_what_it_extends(write: Write) -> None:
    write(SLOPES + VARIANTS, "mine.yaml")
    graph = read_graph(write("format: 1\nextends: [mine.yaml, fine]"))
    assert mm(graph) == 0.05
    assert set(graph.variants) == {"fine", "steep"}, (
        "a variant with a base belongs to its own file alone"
    )


def test_a_variant_of_a_file_applies_to_another_graph(write: Write) -> None:
    file, other = write(SLOPES + VARIANTS, "mine.yaml"), write(SLOPES, "other.yaml")
    overlaid = with_overlays(read_graph(other), [f"{file}/steep"])
    assert (overlaid.name, mm(overlaid)) == ("other_steep", 0.05)
    with pytest.raises(InputError, match="no variant 'steeep'; did you mean 'steep'"):
        with_overlays(read_graph(other), [f"{file}/steeep"])


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        ("  fine: {patch: [{set: pixle, with: {mm: 1}}]}", "variants.fine.patch[0]: set: there is"),
        ("  fine: {titel: x}", "variants.fine.titel: unknown key 'titel'; did you mean 'title'?"),
        ("  fine: {patch: [{sett: pixel}]}", "variants.fine.patch[0].sett: unknown key 'sett'"),
        ("  fine: {nodes: {}}", "variants.fine.nodes: unknown key 'nodes'"),
        ("  fine: {extends: nothing}", "variants.fine.extends: there is no overlay 'nothing'"),
        ("  fine: {base: nothing}", "variants.fine.base: 'nothing' is neither a graph file"),
    ],
)
def test_a_mistake_in_a_variant_is_reported_with_its_place(
    write: Write, mistake: str, message: str
) -> None:
    text = f"{SLOPES}variants:\n{mistake}\n"
    file = write(text, "mine.yaml")
    error = refusal(f"{file}/fine")
    assert error.startswith(f"{file}:{text.count(chr(10))}:")
    assert message in error


def test_a_study_is_its_base_and_its_variants(write: Write) -> None:
    file = write(STUDY, "study.yaml")
    graphs = read_graphs(file)
    assert [graph.name for graph in graphs] == ["base", "base_fine", "base_steep"]
    assert [mm(graph) for graph in graphs] == [0.1, 0.05, 0.05]
    assert graphs[1].title == "At half the size"
    assert graphs[2].title == f"{graphs[0].title}, steep"
    assert read_graph(f"{file}/fine").hash == graphs[1].hash
    with pytest.raises(InputError, match=r"study.yaml' is a study; .*: base_fine, base_steep"):
        read_graph(file)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("base.yaml", "nowhere.yaml", "4:1: base: "),
        ("title:", "nodes: {}\ntitle:", "3:1: nodes: unknown key 'nodes'"),
        ("patch: [{set: pixel", "patch: [{set: pixle", "9:13: variants.fine.patch[0]: set: "),
    ],
)
def test_a_mistake_in_a_study_is_reported_with_its_place(
    write: Write, old: str, new: str, message: str
) -> None:
    file = write(STUDY.replace(old, new, 1).replace("format: 1\n", "\nformat: 1\n"), "study.yaml")
    with pytest.raises(GraphError) as caught:
        read_graphs(file)
    assert str(caught.value).startswith(f"{file}:{message}")


def test_a_graph_that_is_no_study_is_read_as_one_graph(tmp_path: Path) -> None:
    (graph,) = read_graphs(str(tmp_path / "base.yaml"))
    assert graph.name == "base"


def test_a_group_comes_from_a_file_and_is_changed_where_it_is_used(write: Write) -> None:
    graph = read_graph(write(TWICE))
    assert graph.nodes["one.slope"].settings == {"steepest": 9}
    assert graph.nodes["two.slope"].settings == {"steepest": 4}
    assert graph.nodes["one.raw"].op == "integrate_dct"
    assert graph.nodes["two.raw"].op == "integrate_frankot_chellappa"
    assert graph.nodes["two.slope"].inputs == {"height": "one.raw", "pixel": "pixel"}


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("slope: slope.slope", "slope: solpe.slope", "round.group.yaml:7:35: nodes.raw.in.slope"),
        ("slope: slope.slope", "slope: solpe.slope", "(used by "),
        ("op: height_slopes, ", "", "round.group.yaml:6:3: nodes.slope.op: 'op' is missing"),
        ("inputs: {height", "input: {height", "round.group.yaml:3:1: input: unknown key 'input'"),
        ("{help: what", "{hepl: what", "round.group.yaml:3:19: inputs.height.hepl: unknown key"),
        ("outputs: {height: raw}", "outputs: {height: row}", "round.group.yaml:8:11: outputs.hei"),
        ("{set: slope", "{set: slpoe", "graph.yaml:9:9: groups.other.patch[0]: set: the group"),
        ("round.group.yaml}", "other.group.yaml}", "graph.yaml:5:11: groups.plain.extends: "),
        ("round.group.yaml}", "round}", "groups.plain.extends: 'round' is not the file of a group"),
        ("round.group.yaml}", "round.group.yaml, nodes: {}}", "groups.plain.nodes: unknown key"),
    ],
)
def test_a_mistake_in_a_shared_group_is_reported_with_its_place(
    write: Write, old: str, new: str, place: str
) -> None:
    write(GROUP.replace(old, new, 1), "round.group.yaml")
    assert place in refusal(write(TWICE.replace(old, new, 1)))


def test_a_shipped_name_is_a_graph_with_overlays() -> None:
    name = "reconstruct_no_flat_follow_drift"
    overlaid = with_overlays(read_graph("reconstruct"), ["no_flat", "follow_drift"])
    assert (read_graph(name).name, read_graph(name).hash) == (name, overlaid.hash)
    assert len({*shipped_names()}) == len(shipped_names())


def test_the_shipped_files_are_few_and_sorted_by_folder() -> None:
    entries = [each for each in PIPELINES.iterdir() if each.name != "__pycache__"]
    assert len(entries) <= 10
    assert len([*PIPELINES.rglob("*.yaml")]) <= 53
    assert {*shipped("studies")} == {"precise_ablation", "reconstruct_ablation"}


PAGE = (Path(__file__).parents[3] / "docs" / "compose.md").read_text(encoding="utf-8")
FITS = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \| ([^|]*) \|", PAGE, re.MULTILINE)


def test_the_page_names_every_overlay() -> None:
    listed = {name for names, _ in FITS for name in re.findall(r"`(\w+)`", names)}
    assert listed & {*shipped("overlays")} == {*shipped("overlays")}


@pytest.mark.parametrize("graph", ["reconstruct", "precise"])
def test_the_drift_is_followed_in_every_graph_of_flashed_lights(graph: str) -> None:
    followed = with_overlays(read_graph(graph), ["follow_drift"])
    assert followed.entry("drift_2").inputs["before"] == "previous.relight.drift_2"
    make_plan(*to_plan(followed), device=None)


def to_plan(graph: Graph) -> tuple[Graph, dict[str, object]]:
    return replace(graph, prefer=("numpy",)), graph.placeholders
