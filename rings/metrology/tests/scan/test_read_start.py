"""A vendor's light model as the start of a calibration: the light at rest, and where LEDs are."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.one_run import run
from benchmarks.real_film import measure
from rings.metrology.tests.scan.scans import GAIN, LEDS, PIXEL, cap, seen, write_scan
from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.rings.metrology.nodes.scan.light_model import LightModel
from tactograph.rings.metrology.nodes.scan.read_start import read_start
from tests.fixtures import real_data


def test_a_model_tells_light_at_rest_leds_and_pixels(model_file: Path, model: LightModel) -> None:
    found = read_start(seen(cap(), model), file=model_file)
    np.testing.assert_allclose(found.rest, seen(0 * cap(), model), rtol=1e-4)
    azimuth = np.degrees(np.arctan2(*found.slants.T[::-1])) % 360
    off = (azimuth - 60 * np.arange(LEDS) - 10 + 180) % 360 - 180
    assert np.abs(off).max() < 5
    assert found.pixel_size == PIXEL
    assert found.metrics["model_residual"] < 1e-3
    assert GAIN * found.rest.mean() == pytest.approx(0.43, abs=0.1)


def test_film_and_images_foreign_to_the_model_give_warnings(
    model_file: Path, model: LightModel, tmp_path: Path
) -> None:
    light = seen(0 * cap(), model)
    write_scan(tmp_path / "flat", light * np.linspace(0.8, 1, LEDS)[:, None, None])
    with collect_warnings([]) as messages:
        found = read_start(light, file=model_file, flat=tmp_path / "flat")
    assert found.metrics["untouched_slope"] > 0.02
    assert any("untouched film for tilted" in each for each in messages)
    with pytest.raises(InputError, match="describes 6 lights of 96 x 64 pixels, but the press"):
        read_start(light[:, :32].copy(), file=model_file)


@pytest.mark.slow
def test_a_calibration_that_starts_from_the_vendors_needs_no_untouched_film(
    tmp_path: Path,
) -> None:
    """Fitted to a grid of balls, tried on another; no warning about pitch or pixels."""
    grids = real_data("gelsight_six_led")
    cal = tmp_path / "cal.npz"
    start = real_data("gelsight_scans") / "oem/demo-calibration.yaml"
    ball = {"ball_radius_mm": 0.2475, "ball_pitch_mm": 1.0}
    run("calibrate_scan", capture=grids / "balls_1", start=start, out=cal, **ball)
    found = run("reconstruct", capture=grids / "balls_2", calibration=cal)
    grid = measure(found, grids / "balls_2.csv", 1)
    assert grid.normal_deg < 1.45
    assert grid.cap_um < 1.7
