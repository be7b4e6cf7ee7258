"""A node that returns its input unchanged costs a device nothing, and changes no result."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tactograph.graph import load, node
from tactograph.graph.backends.prepared_node import Prepared
from tactograph.nodes import Light
from tests.fixtures import Calibration, Raytraced
from tests.graph.conftest import graph_of

pytestmark = pytest.mark.usefixtures("toys")

GRAPH = """
format: 1
title: Images through a lens
params:
  count: {kind: integer}
  bend: {kind: number, default: 0}
prefer: [opencl, numpy]
nodes:
  frames: {op: touches, with: {count: $count}}
  lens:   {op: camera_lens, with: {bend: $bend}}
  image:  {op: undistort, in: {image: frames.image, lens: lens}}
  flat:   {op: at_rest, with: {rows: 24, columns: 32}}
  light:  {op: flat_field, in: {image: image, flat: flat.flat, dark: flat.dark}}
outputs: {light: light}
"""
AND_THE_IMAGE = GRAPH.replace("{light: light}", "{light: light, image: image}")
READ_AS_FRACTIONS = GRAPH.replace(
    "nodes:\n", "nodes:\n  more: {op: doubled, in: {image: image}}\n"
).replace("{light: light}", "{light: light, more: more}")
STACK = np.random.default_rng(0).integers(0, 255, (3, 24, 32))
BACKENDS = ("numpy", "opencl")
IMAGES = {"u8": STACK.astype(np.uint8), "f4": (STACK / 255).astype(np.float32)}


@pytest.fixture
def launched(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The nodes that a device ran, in order, and the type of image that each read."""
    names: list[str] = []
    launch = Prepared.launch

    def watched(self: Prepared, inputs: Any) -> Any:
        if "image" in inputs:
            names.append(f"{self._node.name} {inputs['image'].dtype}")
        return launch(self, inputs)

    monkeypatch.setattr(Prepared, "launch", watched)
    return names


@pytest.mark.parametrize("kind", IMAGES)
@pytest.mark.parametrize("graph", [GRAPH, AND_THE_IMAGE, READ_AS_FRACTIONS])
@pytest.mark.parametrize("bend", [0.0, 0.04])
def test_light_is_the_same_with_and_without_a_device(graph: str, kind: str, bend: float) -> None:
    results = [load(graph_of(graph), backend=b, bend=bend)(frames=IMAGES[kind]) for b in BACKENDS]
    for name in results[0]:
        np.testing.assert_allclose(results[1][name], results[0][name], atol=1e-4 if bend else 0)
        assert results[1][name].dtype == np.float32


@pytest.mark.parametrize(
    ("graph", "bend", "ran"),
    [
        (GRAPH, 0, ["flat_field uint8"]),
        (GRAPH, 0.04, ["undistort uint8", "flat_field float32"]),
        (AND_THE_IMAGE, 0, ["undistort uint8", "flat_field float32"]),
    ],
    ids=["the camera's bytes", "fractions behind a lens", "fractions that another node needs too"],
)
def test_a_device_reads_bytes_unless_a_node_needs_fractions(
    launched: list[str], graph: str, bend: float, ran: list[str]
) -> None:
    load(graph_of(graph), backend="opencl", bend=bend)(frames=IMAGES["u8"])
    assert launched == ran


def test_idle_nodes_take_no_time(toys: list[str]) -> None:
    other = "  other:  {op: undistort, in: {image: frames.image, lens: lens}}\n  flat:"
    twice = GRAPH.replace("  flat:", other).replace(
        "{light: light}", "{light: light, other: other}"
    )
    result = load(graph_of(twice), backend="opencl")(frames=IMAGES["f4"])
    assert result.times["image"] == result.times["other"] == 0
    assert result.times["light"] > 0
    np.testing.assert_array_equal(result["other"], IMAGES["f4"])


def test_a_buffer_that_was_passed_on_is_not_overwritten_by_the_next_image() -> None:
    straight = load(graph_of(GRAPH), backend="opencl")
    first = straight(frames=IMAGES["f4"])["light"].copy()
    flipped = straight(frames=IMAGES["f4"][:, ::-1])["light"]
    np.testing.assert_array_equal(flipped, first[:, ::-1])


def test_a_node_that_would_only_repeat_another_is_not_run() -> None:
    """The first image has no glare to add."""
    graph = graph_of(
        "format: 1\nprefer: [opencl, numpy]\nnodes:\n"
        "  frames: {op: touches}\n"
        "  glare:  {op: glared, in: {image: frames.image}}\n"
        "  once:   {op: summed, in: {image: glare.image}}\n"
        "  again:  {op: summed, in: {image: glare.image, before: glare.glare}}\n"
        "outputs: {once: once, again: again}\n"
    )
    results = [list(load(graph, backend=backend).items()) for backend in BACKENDS]
    for number, (host, device) in enumerate(zip(*results, strict=True), start=1):
        np.testing.assert_array_equal(device["once"], host["once"])
        np.testing.assert_array_equal(device["again"], host["again"])
        assert (device.times["again"] == 0) == (number == 1)


@pytest.mark.parametrize("level", [0.0, 0.25])
@pytest.mark.parametrize("stray", ["low", "high"])
def test_a_number_that_is_0_is_treated_as_absent(stray: str, level: float) -> None:
    """The result does not depend on which of the two nodes reads the number."""
    reads = {name: ", stray: stray" if name == stray else "" for name in ("low", "high")}
    graph = graph_of(
        "format: 1\nprefer: [opencl, numpy]\nnodes:\n"
        "  frames: {op: touches}\n"
        f"  stray:  {{op: stray_light, with: {{level: {level}}}}}\n"
        f"  once:   {{op: halves, in: {{image: frames.image{reads['low']}}}}}\n"
        f"  again:  {{op: halves, in: {{image: frames.image{reads['high']}}}}}\n"
        "outputs: {once: once.low, again: again.high}\n"
    )
    host, device = (next(iter(load(graph, backend=backend).items())) for backend in BACKENDS)
    np.testing.assert_array_equal(device["once"], host["once"])
    np.testing.assert_array_equal(device["again"], host["again"])
    assert (device.times["again"] == 0) == (level == 0)


@pytest.mark.slow
def test_film_without_interreflection_computes_none(
    raytraced: Raytraced, calibration: Calibration, tmp_path: Path, backend: str
) -> None:
    """Film with interreflection is computed anew: a device keeps nothing from before."""
    matt, bright = calibration("far28"), tmp_path / "bright.npz"
    with np.load(matt, allow_pickle=False) as known:
        np.savez(bright, **{**known, "albedo": np.float32(0.5)})
    graph = graph_of("format: 1\nextends: reconstruct\noutputs: {thrown: bounce, height: height}\n")
    params: dict[str, Any] = {"capture": raytraced / "far28/sphere_film", "backend": backend}
    none, some = (next(iter(load(graph, calibration=c, **params).items())) for c in (matt, bright))
    assert none["thrown"] is None
    assert some["thrown"].max() > 0.01
    if backend == "opencl":
        assert none.times["relight.bounce"] == 0
        assert some.times["relight.bounce"] > 0
    without = next(iter(load("reconstruct_no_bounce", calibration=matt, **params).items()))
    np.testing.assert_allclose(none["height"], without["height"], atol=1e-6)


def test_only_a_node_with_an_input_to_return_can_be_idle() -> None:
    @node
    def halved(image: Light) -> Light:
        return image / 2

    with pytest.raises(TypeError, match="only a node whose neutral is an input"):
        halved.idle(lambda: True)
