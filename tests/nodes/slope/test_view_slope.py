"""A camera near the film sees a projective image of it, which can be inverted exactly."""

import numpy as np
import pytest

from tactograph.nodes.height.integrate_dct import integrate_dct
from tactograph.nodes.height.rest_at_border import rest_at_border
from tactograph.nodes.height.undo_perspective import undo_perspective
from tactograph.nodes.slope.view_slope import view_slope
from tests.nodes.films import ball_seen

CAMERA = 1 / 65
SIZE = 150, 200
PIXEL = 20 / SIZE[1]
V, U = (np.mgrid[:150, :200] - np.array([74.5, 99.5])[:, None, None]) * PIXEL


def test_a_plane_stays_a_plane_in_the_view_and_comes_back() -> None:
    p, q, c = 0.2, -0.15, 0.8
    seen = (p * U + q * V + c) / (1 - CAMERA * c)
    slope = np.broadcast_to(np.float32([p, q])[:, None, None], (2, *SIZE))
    found = view_slope(slope, seen.astype(np.float32), CAMERA, PIXEL)
    rows, columns = np.gradient(seen, PIXEL)
    assert found == pytest.approx(np.stack([columns, rows]), abs=1e-5)
    z = undo_perspective(seen.astype(np.float32), CAMERA)
    x, y = U * (1 - CAMERA * z), V * (1 - CAMERA * z)
    assert z == pytest.approx(p * x + q * y + c, abs=1e-5)


def test_the_slopes_of_a_pressed_ball_integrate_to_its_height_and_come_back() -> None:
    seen, slope, _ = ball_seen(6.0, 4.0, (2.0, -1.0), CAMERA, SIZE)
    there = view_slope(slope, seen, CAMERA, PIXEL)
    found = undo_perspective(rest_at_border(integrate_dct(there, PIXEL)), CAMERA)
    true = seen / (1 + CAMERA * seen)
    assert np.sqrt(np.square(found - true).mean()) < 0.003
    as_from_afar = rest_at_border(integrate_dct(slope, PIXEL))
    assert np.sqrt(np.square(as_from_afar - true).mean()) > 0.008
    back = view_slope(there, seen, CAMERA, PIXEL, inverse=True)
    assert np.abs(there - slope).max() > 0.02
    assert back == pytest.approx(slope, abs=1e-5)


def test_film_that_hardly_faces_the_camera_has_the_steepest_visible_slope() -> None:
    """Slopes of 28, as noise makes them at rims, would rise by metres in the camera's view."""
    slope = np.zeros((2, *SIZE), np.float32)
    slope[:, 40:110, 60:140] = np.float32([28, 3])[:, None, None]
    seen = view_slope(slope, np.full(SIZE, 2, np.float32), CAMERA, PIXEL)
    steepest = np.hypot(*seen).max()
    assert steepest == pytest.approx(np.sqrt(1 / 0.1**2 - 1), rel=1e-4)
    assert seen[0, 75, 100] == pytest.approx(seen[1, 75, 100] * 28 / 3, rel=1e-4)


def test_a_camera_far_away_changes_nothing() -> None:
    seen, slope, _ = ball_seen(6.0, 4.0, (2.0, -1.0), 0.0, SIZE)
    assert view_slope(slope, seen, 0.0, PIXEL) is slope
    assert np.array_equal(undo_perspective(seen, 0.0), seen)
