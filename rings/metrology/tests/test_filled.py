"""An object that fills the frame: no film is at rest, so nothing shows its brightness."""

from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import load
from tactograph.graph.run.result import Result
from tactograph.nodes import BAND_DEVIATIONS, F4
from tactograph.nodes.calibrate.file.read_calibration import read_calibration
from tactograph.nodes.optics.near_light import matt_film_light
from tactograph.rings.metrology.nodes.surface.measure_step import measure_step
from tests.fixtures import Calibration

DEPTH_MM = 0.45


@pytest.fixture(scope="module")
def sensor(calibration: Calibration) -> Path:
    return Path(calibration("far28"))


def seen(sensor: Path, brighter: float) -> tuple[F4, float]:
    """Images of a groove through the frame, brighter at its bottom; the size of a pixel."""
    known = read_calibration(file=sensor)
    pixel, (rows, columns) = known.pixel_size, known.flat.shape[1:]
    x = pixel * np.abs(np.arange(columns) - columns / 2)
    wall = DEPTH_MM / np.tan(np.radians(25))
    profile = np.clip((columns * pixel / 7 + wall / 2 - x) / wall, 0, 1)
    z = np.tile(-DEPTH_MM * profile, (rows, 1)).astype(np.float32)
    slope = np.stack(np.gradient(z / np.float32(pixel))[::-1])
    light = matt_film_light(known.film.lights, z, slope, pixel)
    noise = np.random.default_rng(0).normal(1, 0.005, light.shape)
    image = np.maximum(light, 0) * known.flat * 1.045 * (1 + brighter * profile) + known.dark
    return (image * noise).astype(np.float32), pixel


def measured(
    graph: str, sensor: Path, brighter: float, **arguments: object
) -> tuple[dict[str, float], Result]:
    image, pixel = seen(sensor, brighter)
    found = load(graph, calibration=sensor, accept_contradictions=True, **arguments)(frames=image)
    known = (1e3 * DEPTH_MM, 0.2)
    return measure_step(found["height"], pixel, found.get("error"), certified_um=known), found


@pytest.mark.parametrize("graph", ["reconstruct_filled", "precise_filled"])
def test_the_depth_of_a_groove_through_the_frame(sensor: Path, graph: str) -> None:
    figures, found = measured(graph, sensor, 0.0)
    assert not found.warnings
    assert figures["step_depth_um"] == pytest.approx(1e3 * DEPTH_MM, abs=2)
    assert figures["step_spread_um"] < 1


@pytest.mark.slow
def test_the_error_states_what_brightness_may_hide(sensor: Path) -> None:
    figures, found = measured("precise_filled", sensor, 0.05)
    band = BAND_DEVIATIONS * figures["step_uncertainty_um"]
    assert abs(figures["step_depth_um"] - 1e3 * DEPTH_MM) < band
    assert any("no film is taken for film at rest" in line for line in found.warnings)


@pytest.mark.slow
def test_a_known_step_settles_the_scale(sensor: Path) -> None:
    first, _ = measured("precise_filled", sensor, 0.01)
    scale = (first["step_scale"], first["step_scale_error"])
    again, found = measured("precise_filled", sensor, 0.01, scale=scale)
    assert again["step_depth_um"] == pytest.approx(1e3 * DEPTH_MM, abs=1)
    assert again["step_uncertainty_um"] < first["step_uncertainty_um"]
    assert not any("no film is taken" in line for line in found.warnings)
