"""One pixel's light does not show on which side of an edge its height lies."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.error.unresolved_edges import unresolved_edges
from tactograph.nodes.evaluate.evaluate_error import evaluate_error

PIXEL_MM = 0.1
EDGE = 10
"""The first column of the upper side."""


def wall(rise_px: float) -> F4:
    height = np.zeros((12, 20), np.float32)
    height[:, EDGE:] = rise_px * PIXEL_MM
    return height


def test_pixels_on_both_sides_of_an_edge_are_marked() -> None:
    marked = unresolved_edges(wall(6.0), PIXEL_MM)[6]
    assert marked[EDGE - 2 : EDGE + 2].all()
    assert not marked[: EDGE - 2].any()
    assert not marked[EDGE + 2 :].any()


@pytest.mark.parametrize(
    "height", [wall(2.5), PIXEL_MM * np.indices((12, 20), np.float32)[1] * 4], ids=["low", "ramp"]
)
def test_a_low_step_and_an_even_wall_are_resolved(height: F4) -> None:
    assert not unresolved_edges(height, PIXEL_MM)[:, 2:-2].any()


def test_blur_hides_an_edge_of_less_height() -> None:
    assert unresolved_edges(wall(2.5), PIXEL_MM, 0.5)[6, EDGE - 2 : EDGE + 2].all()


def test_the_band_leaves_unresolved_pixels_out_and_counts_them() -> None:
    height, error = wall(6.0), np.full((12, 20), 0.01, np.float32)
    truth = np.roll(height, 1, axis=1)
    truth[:, 0] = 0
    marked = unresolved_edges(height, PIXEL_MM)
    assert evaluate_error(height, error, truth)["in_90_percent_band"] == pytest.approx(95)
    figures = evaluate_error(height, error, truth, unresolved=marked)
    assert figures["in_90_percent_band"] == 100
    assert figures["unresolved_percent"] == pytest.approx(20)


def test_film_at_rest_does_not_decide_the_band() -> None:
    """One half of the frame is rightly held at zero, the other half is off."""
    error, touched = np.full((2, 4, 6), 0.01, np.float32)
    touched[:, :3] = 0
    truth, height = 2 * touched, 0 * touched
    assert evaluate_error(height, error, truth)["in_90_percent_band"] == 50
    figures = evaluate_error(height, error, truth, touched)
    assert figures["in_90_percent_band"] == 0
    assert figures["stated_over_actual"] == pytest.approx(0.5)
    assert evaluate_error(height, error, truth, 0 * touched) == {}


def test_stated_over_actual_compares_root_mean_squares() -> None:
    truth, error = np.full((4, 5), 0.02, np.float32), np.full((4, 5), 0.01, np.float32)
    figures = evaluate_error(np.zeros_like(truth), error, truth)
    assert figures["stated_over_actual"] == pytest.approx(0.5)
    assert figures["max_resolved_error_um"] == pytest.approx(20)


def test_if_all_is_unresolved_only_its_share_is_stated() -> None:
    plane = np.ones((4, 5), np.float32)
    figures = evaluate_error(plane, plane, plane, unresolved=np.ones((4, 5), np.uint8))
    assert figures == {"unresolved_percent": 100}
