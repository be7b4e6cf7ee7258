"""Grooves and steps of known depth, width and walls."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import assume, example, given, settings, strategies as st

from benchmarks.one_run import run
from rings.metrology.tests.scan.scans import groove_shape
from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4
from tactograph.nodes.drawing.new_picture import Colour
from tactograph.rings.metrology.nodes.surface.measure_step import measure_step
from tactograph.rings.metrology.nodes.surface.plot_step import plot_step
from tactograph.rings.shapes.nodes.shape_grating import shape_grating

PIXEL = 0.005


def groove(depth: float, width: float, wall_deg: float, tilt: float = 0.0) -> F4:
    """A groove of so many mm across the middle of 60 x 600 px, its width at half depth."""
    z = groove_shape(depth, wall_deg, width, (60, 600), PIXEL)
    return z + tilt * PIXEL * (np.arange(600, dtype=np.float32) - 300)


@settings(max_examples=30)
@given(
    depth=st.floats(0.02, 0.3),
    width=st.floats(0.5, 0.9),
    wall=st.floats(30, 70),
    tilt=st.floats(-0.005, 0.005),
)
@example(depth=0.02, width=0.5, wall=30.0, tilt=0.005)
@example(depth=0.02, width=0.9, wall=45.0, tilt=-0.02)
def test_a_groove_has_its_depth_width_and_walls(
    depth: float, width: float, wall: float, tilt: float
) -> None:
    assume(2 * PIXEL < depth / np.tan(np.radians(wall)) < 0.6 * width)
    figures = measure_step(groove(depth, width, wall, tilt), PIXEL)
    assert figures["step_depth_um"] == pytest.approx(1e3 * depth, rel=5e-3, abs=0.2)
    assert figures["step_width_mm"] == pytest.approx(width, abs=2 * PIXEL)
    assert figures["wall_1_deg"] == pytest.approx(wall, abs=4)
    assert figures["wall_2_deg"] == pytest.approx(wall, abs=4)


def test_walls_that_reach_into_the_levels_give_a_warning() -> None:
    with collect_warnings([]) as messages:
        measure_step(groove(0.3, 0.5, 32), PIXEL)
    assert "the height states no error" in messages[0]
    assert "too narrow for its walls" in messages[1]


def test_ridges_turned_maps_and_unknown_film_measure_the_same() -> None:
    z = groove(0.1, 0.6, 45)
    assert measure_step(-z, PIXEL)["step_depth_um"] == pytest.approx(-100, abs=1)
    assert measure_step(np.ascontiguousarray(z.T), PIXEL, along="y") == measure_step(z, PIXEL)
    z[:30, 290:295] = np.nan
    assert measure_step(z, PIXEL)["step_depth_um"] == pytest.approx(100, abs=1)


def test_a_step_down_has_a_positive_depth() -> None:
    x = PIXEL * (np.arange(600) - 299.5)
    z = np.tile(np.float32(-np.clip((x + 0.05) / 0.1, 0, 1) * 0.08 + 0.001 * x), (40, 1))
    figures = measure_step(z, PIXEL, edges=1)
    assert figures["step_depth_um"] == pytest.approx(80, rel=0.01)
    assert figures["wall_1_deg"] == pytest.approx(38.7, abs=3)


def test_the_uncertainty_holds_the_spread_and_the_stated_error() -> None:
    z = groove(0.1, 0.6, 45)
    noisy = z + np.random.default_rng(1).normal(0, 0.002, z.shape).astype(np.float32)
    of_spread = measure_step(noisy, PIXEL)
    assert 0 < of_spread["step_uncertainty_um"] < of_spread["step_spread_um"]
    stated = measure_step(noisy, PIXEL, np.full_like(z, 0.004))
    assert stated["step_uncertainty_um"] >= 4


def test_a_plane_holds_no_groove() -> None:
    with pytest.raises(InputError, match="0 of 60 profiles along x show a groove"):
        measure_step(np.zeros((60, 600), np.float32), PIXEL)


def test_a_known_depth_gives_the_scale_of_heights() -> None:
    figures = measure_step(groove(0.1, 0.6, 45), PIXEL, certified_um=(102.0, 0.5))
    assert figures["step_scale"] == pytest.approx(1.02, abs=2e-3)
    assert figures["step_scale_error"] == pytest.approx(0.005, rel=0.1)
    with pytest.raises(InputError, match="a depth above 0 is needed"):
        measure_step(groove(0.1, 0.6, 45), PIXEL, certified_um=(0.0, 0.5))


def test_the_command_reads_the_error_next_to_the_height(tmp_path: Path) -> None:
    z, given = groove(0.1, 0.6, 45), {"height": tmp_path / "height.npy", "pixel_size_mm": PIXEL}
    np.save(tmp_path / "height.npy", z)
    alone = run("measure_step", **given)["step"]
    np.save(tmp_path / "error.npy", np.full_like(z, 1e-3))
    stated = run("measure_step", **given)["step"]
    assert alone["step_uncertainty_um"] < 0.1
    of_edges = 1e3 * PIXEL * (1 - 2 * np.tan(np.radians(22.5))) / np.sqrt(3)
    assert stated["step_uncertainty_um"] == pytest.approx(np.hypot(np.sqrt(2), of_edges), rel=0.02)


def test_a_picture_shows_the_levels_and_the_depth(tmp_path: Path) -> None:
    z, file = groove(0.1, 0.6, 45), tmp_path / "step.png"
    plot_step(z, PIXEL, measure_step(z, PIXEL), file=file)
    picture = cv2.imread(str(file))
    assert picture.shape == (400, 900, 3)
    for colour in (Colour.BLUE, Colour.ORANGE):
        bgr = np.array([int(colour[i : i + 2], 16) for i in (5, 3, 1)])
        assert (np.abs(picture.astype(int) - bgr).max(axis=2) < 8).sum() > 100


@pytest.mark.parametrize(("depth", "wall"), [(0.5, 40.0), (0.2, 20.0)])
@pytest.mark.parametrize("along", ["x", "y"])
def test_a_measured_groove_has_its_true_dimensions(depth: float, wall: float, along: str) -> None:
    angle = 0.0 if along == "x" else 90.0
    one = {"middle": "groove", "period_mm": 9.0, "duty": 2 / 3, "rise_mm": depth}
    made = shape_grating(wall_deg=wall, angle_deg=angle, **one)
    middle = made.height[60:180, 80:240] if along == "x" else made.height[40:200, 100:220]
    found = measure_step(middle, made.pixel_size, along=along)
    assert found["step_depth_um"] == pytest.approx(1e3 * depth, abs=0.5)
    assert found["step_width_mm"] == pytest.approx(3.0, abs=0.02)
    assert found["wall_1_deg"] == pytest.approx(wall, abs=1)
