"""Slopes and normals against the truth."""

import numpy as np
import pytest

from tactograph.nodes.evaluate.evaluate_slope import evaluate_slope

FLAT = np.zeros((2, 6, 7), np.float32)


def plane(p: float, q: float) -> np.ndarray:
    return np.stack([np.full((6, 7), p), np.full((6, 7), q)]).astype(np.float32)


@pytest.mark.parametrize("degrees", [0.001, 1.0, 45.0, 80.0])
def test_the_error_of_a_tilted_plane_is_its_angle(degrees: float) -> None:
    tilted = plane(float(np.tan(np.radians(degrees))), 0)
    figures = evaluate_slope(FLAT, 0.1, tilted)
    assert figures["normal_error_deg"] == pytest.approx(degrees, rel=1e-5)


def test_the_rmse_is_over_both_components() -> None:
    figures = evaluate_slope(plane(0.3, 0.4), 0.1, FLAT)
    assert figures["slope_rmse"] == pytest.approx(np.sqrt((0.3**2 + 0.4**2) / 2))
    assert evaluate_slope(FLAT, 0.1) == {}, "without a truth there are no figures"


def test_without_true_slopes_the_true_height_is_differentiated() -> None:
    height = np.tile(np.arange(7, dtype=np.float32) * np.float32(0.05), (6, 1))
    figures = evaluate_slope(plane(0.5, 0), 0.1, height=height)
    assert figures["slope_rmse"] == pytest.approx(0, abs=1e-6)
    assert figures["normal_error_deg"] == pytest.approx(0, abs=1e-4)


def test_steps_do_not_count_towards_the_slope() -> None:
    truth = FLAT.copy()
    truth[0, :, 3] = 50
    assert evaluate_slope(FLAT, 0.1, truth)["slope_rmse"] == 0
    assert "slope_rmse" not in evaluate_slope(FLAT, 0.1, plane(50, 0))
