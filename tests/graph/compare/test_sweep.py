"""Sweeps as users write them, and the runs that follow from them."""

import pytest

from tactograph.graph import InputError
from tactograph.graph.compare.sweep import (
    Sweep,
    check_targets,
    has_parameter,
    points,
    read_sweep,
    seed_like,
    seeds,
)
from tactograph.graph.files.read_graph import read_graph
from tests.graph.conftest import graph_of

NOISY = """
format: 1
params:
  seed: {kind: integer, default: 7}
nodes:
  shape:  {op: shape_ball, with: {width_px: 32, height_px: 24}}
  lights: {op: light_ring}
  scene:  {op: render, in: {height: shape.height, pixel: shape.pixel_size, lights: lights}}
  camera: {op: expose, in: {light: scene.light}, with: {seed: $seed}}
outputs: {image: camera.image}
"""


GROUPED = """
format: 1
groups:
  shot:
    inputs: {light: {}}
    params: {seed: {default: 3}}
    nodes: {camera: {op: expose, in: {light: light}, with: {seed: $seed}}}
    outputs: {image: camera.image}
nodes:
  cal: {op: at_rest}
  a: {group: shot, in: {light: cal.flat}}
  b: {group: shot, in: {light: cal.flat}, with: {seed: 5}}
outputs: {image: b.image}
"""


def test_a_parameter_may_be_one_of_a_group() -> None:
    graph = graph_of(GROUPED)
    for target, first in {"shot.seed": 3, "b.seed": 5, "shot.camera.seed": 3}.items():
        sweep = read_sweep(f"{target}=1,2")
        check_targets([graph], [target], "--sweep")
        assert points(graph, [sweep]) == [{target: 1}, {target: 2}]
        assert seeds(graph, target, 2, {}) == [{target: first}, {target: first + 1}]
    with pytest.raises(InputError, match="'b' has no param 'sede'; it has: seed"):
        check_targets([graph], ["b.sede"], "--sweep")
    with pytest.raises(InputError, match=r"node 'shot.camera' \(expose\) has no parameter 'sede'"):
        check_targets([graph], ["shot.camera.sede"], "--sweep")


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("0.1..0.3:3", (0.1, 0.2, 0.3)),
        ("15..60:4", (15, 30, 45, 60)),
        ("0..1:5", (0.0, 0.25, 0.5, 0.75, 1.0)),
        ("-1.5..1.5:2", (-1.5, 1.5)),
        ("3..1:3", (3, 2, 1)),
        ("log:0.01..1:3", (0.01, 0.1, 1.0)),
        ("1,2,4", (1, 2, 4)),
        ("0.5, true, text", (0.5, True, "text")),
    ],
)
def test_a_range_or_a_list_gives_the_values_swept(text: str, values: tuple[object, ...]) -> None:
    swept = read_sweep(f"node.param={text}").values
    assert swept == pytest.approx(values) if "text" not in text else swept == values
    assert list(map(type, swept)) == list(map(type, values))


@pytest.mark.parametrize(
    "word",
    [
        "node.param", "param=1,2", "node.=1,2", "node.param=1", "node.param=1,1", "node.param=",
        "node.param=1..2", "node.param=1..2:1", "node.param=1..2:x", "node.param=a..2:3",
        "node.param=log:0..1:3", "node.param=1..1:3", "node.param=1..2:100000", "a b.c=1,2",
    ],
)  # fmt: skip
def test_a_wrong_sweep_is_refused_in_one_line(word: str) -> None:
    with pytest.raises(InputError, match="--sweep") as error:
        read_sweep(word)
    assert "\n" not in str(error.value)
    assert "int()" not in str(error.value)


def test_two_sweeps_make_a_grid() -> None:
    sweeps = [Sweep("shadow.threshold", (2, 4)), Sweep("frames.single", (True, False))]
    grid = points(read_graph("paper"), sweeps)
    assert len(grid) == 4
    assert grid[1] == {"shadow.threshold": 2, "frames.single": False}


def test_a_variant_without_the_node_runs_once() -> None:
    sweeps = [Sweep("shadow.threshold", (2, 4))]
    assert points(read_graph("paper_no_shadow"), sweeps) == [{}]
    assert points(read_graph("simulate"), sweeps) == [{}]
    assert not has_parameter(read_graph("paper"), "shadow.nonsense")


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("shadow.treshold", "it has: threshold"),
        ("shaddow.threshold", "no graph has a node 'shaddow'"),
    ],
)
def test_a_sweep_over_an_unknown_target_names_the_mistake(target: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        check_targets([read_graph("paper")], [target], "--sweep")
    with pytest.raises(InputError, match="taken out"):
        check_targets([read_graph("paper_no_shadow")], ["shadow.threshold"], "--sweep")


def test_seeds_are_whole_numbers_and_count_up_from_the_graphs_own() -> None:
    graph = graph_of(NOISY)
    assert seed_like([graph]) == ["camera.seed"]
    assert seeds(graph, "camera.seed", 3, {}) == [{"camera.seed": s} for s in (7, 8, 9)]
    assert seeds(graph, "camera.seed", 2, {"seed": 1})[1] == {"camera.seed": 2}
    assert seeds(read_graph("paper"), "camera.seed", 3, {}) == [{}]
    with pytest.raises(InputError, match="whole number"):
        seeds(graph, "camera.read_noise", 2, {})
