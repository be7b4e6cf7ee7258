"""Known slopes: of a ball in closed form, of any height by differences."""

import numpy as np
import pytest

from tactograph.nodes.calibrate.ball.ball_slopes import ball_slopes
from tactograph.nodes.slope.height_slopes import height_slopes
from tests.nodes.scenes import ball, waves

LIGHT = np.zeros((4, 100, 120), np.float32)


def test_a_ball_falls_off_away_from_its_centre() -> None:
    known = ball_slopes(LIGHT, np.array([60, 50], np.float32), 40.0, 0.1, radius_mm=5.0)
    assert known.slope[0, 50, 80] < 0 < known.slope[0, 50, 40]
    assert known.slope[1, 70, 60] < 0 < known.slope[1, 30, 60]
    assert known.slope[:, 50, 60] == pytest.approx(0)
    known = ball_slopes(LIGHT, np.array([10, 50], np.float32), 100.0, 0.1, radius_mm=5 * np.sqrt(2))
    assert known.slope[0, 50, 60] == pytest.approx(-1, abs=1e-5), "at sin 45 of the radius"


def test_the_mask_ends_a_margin_inside_the_contact() -> None:
    known = ball_slopes(
        LIGHT, np.array([60, 50], np.float32), 30.0, 0.1, radius_mm=5.0, margin_px=2.0
    )
    assert known.mask[50, 60 + 27] == 1
    assert known.mask[50, 60 + 29] == 0
    assert not known.slope[:, known.mask == 0].any()


def test_differences_of_a_surface_are_its_slopes() -> None:
    z, slope = waves(100, 120)
    known = height_slopes(z, 1.0)
    assert np.abs(known.slope - slope)[:, 1:-1, 1:-1].max() < 1e-3
    assert np.abs(known.slope - slope).max() < 0.02
    z, slope = ball(60, 80, 100)
    differences = height_slopes(z * 0.05, 0.05).slope
    assert np.abs(differences - slope)[:, 1:-1, 1:-1].max() < 1e-3, "the pixel size divides"


def test_a_step_is_masked_out() -> None:
    z = np.zeros((20, 20), np.float32)
    z[:, 10:] = 5
    known = height_slopes(z, 0.1)
    assert not known.mask[:, 9:11].any()
    assert known.mask[:, :9].all()
