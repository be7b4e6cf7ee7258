"""Errors as the paper's Table 1 states them."""

import numpy as np
import pytest

from tactograph.nodes.evaluate.evaluate_height import evaluate_height

TRUTH = np.zeros((40, 50), np.float32)
TRUTH[10:20, 10:30] = 2.0


def test_the_truth_itself_has_no_error_and_without_it_there_are_no_figures() -> None:
    figures = evaluate_height(TRUTH, 0.1, TRUTH)
    assert (figures["max_error_px"], figures["rmse_px"], figures["over_10_percent"]) == (0, 0, 0)
    assert figures["peak_px"] == pytest.approx(20)
    assert evaluate_height(TRUTH, 0.1) == {}


def test_errors_are_in_pixels_and_micrometres_and_the_share_is_of_the_objects_area() -> None:
    height = TRUTH.copy()
    height[0, :10] = 0.5
    for pixel in (0.1, 0.02):
        figures = evaluate_height(height, pixel, TRUTH)
        assert figures["max_error_px"] == pytest.approx(0.5 / pixel)
        assert figures["max_error_um"] == pytest.approx(500)
        assert figures["rmse_um"] == pytest.approx(500 * np.sqrt(10 / TRUTH.size))
        assert figures["rmse_um"] == pytest.approx(1000 * pixel * figures["rmse_px"])
        assert figures["over_10_percent"] == pytest.approx(100 * 10 / 200)


def test_a_tenth_of_the_objects_height_is_the_limit() -> None:
    assert evaluate_height(TRUTH + np.float32(0.19), 0.1, TRUTH)["over_10_percent"] == 0
    assert evaluate_height(TRUTH + np.float32(0.21), 0.1, TRUTH)["over_10_percent"] == 1000
