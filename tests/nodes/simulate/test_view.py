"""The view of a near camera, where geometry gives the truth."""

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes import F4
from tactograph.nodes.simulate.shape_ball import shape_ball
from tactograph.nodes.simulate.view import Viewed, view

PIXEL = 0.1
ROWS, COLUMNS = 81, 101


def viewed(height: F4, camera_mm: float = 0.0, lens_at_corner: float = 0.0) -> Viewed:
    """The view through a camera; light 1 encodes the column and light 2 the row."""
    row, column = np.indices(height.shape).astype(np.float32)
    light, slope = np.stack([column, row]), np.stack([column, -row])
    labels = np.indices(height.shape).sum(axis=0).astype(np.uint8)
    lens = {"camera_mm": camera_mm, "lens_at_corner": lens_at_corner}
    return view(light, height, slope, labels, **lens)


def places() -> F4:
    """x and y in px from the middle, 2 x H x W."""
    y, x = np.indices((ROWS, COLUMNS)).astype(np.float32)
    return np.stack([x - (COLUMNS - 1) / 2, y - (ROWS - 1) / 2])


def plateau(level: float) -> F4:
    return np.full((ROWS, COLUMNS), level, np.float32)


def test_a_distant_camera_with_an_ideal_lens_sees_the_film_unchanged() -> None:
    height = shape_ball(radius_mm=3.0, width_px=COLUMNS, height_px=ROWS, pixel_size_mm=PIXEL).height
    result = viewed(height)
    np.testing.assert_array_equal(result.height, height)
    np.testing.assert_array_equal(result.light[0], np.indices(height.shape)[1])
    np.testing.assert_array_equal(result.labels, np.indices(height.shape).sum(axis=0))


@pytest.mark.parametrize("level", [-1.0, 0.0, 2.0])
def test_film_closer_to_the_camera_looks_larger(level: float) -> None:
    result = viewed(plateau(level), camera_mm=20.0)
    x, y = places() * (1 - level / 20)
    inside = (np.abs(x) <= (COLUMNS - 1) / 2) & (np.abs(y) <= (ROWS - 1) / 2)
    np.testing.assert_allclose((result.light[0] - (COLUMNS - 1) / 2)[inside], x[inside], atol=1e-3)
    np.testing.assert_allclose((result.light[1] - (ROWS - 1) / 2)[inside], y[inside], atol=1e-3)
    np.testing.assert_allclose(result.height, level)


def test_each_pixel_has_the_height_where_its_ray_meets_the_film() -> None:
    # On a plane z = p x the ray (u f, z) with f = 1 - z / D meets it at z = p u / (1 + p u / D).
    p, camera = 0.4, 30.0
    u = places()[0] * np.float32(PIXEL)
    result = viewed(np.float32(p * u), camera_mm=camera)
    expected = p * u / (1 + p * u / camera)
    inside = np.abs(u) < 4
    np.testing.assert_allclose(result.height[inside], expected[inside], atol=1e-4)


def test_a_high_wall_hides_the_film_behind_it() -> None:
    height, camera, rise, edge = plateau(0.0), 10.0, 2.0, 70
    height[:, edge : edge + 5] = rise
    result = viewed(height, camera_mm=camera).height[40]
    # Seen from the middle: it ends where the ray over its outer edge meets the film at rest.
    outer = edge + 4 - (COLUMNS - 1) / 2
    hidden_to = (COLUMNS - 1) / 2 + outer / (1 - rise / camera)
    assert (result > 0.05).nonzero()[0].max() == pytest.approx(hidden_to, abs=1.5)
    assert (result > 0.05).nonzero()[0].min() == pytest.approx(edge, abs=1.5)


@pytest.mark.parametrize("lens", [-0.1, 0.05])
def test_the_lens_moves_the_corner_against_the_middle(lens: float) -> None:
    result = viewed(plateau(0.0), lens_at_corner=lens)
    x, y = places()
    square = (x * x + y * y) / (x[0, 0] ** 2 + y[0, 0] ** 2)
    expected = x * (1 + lens * (square - 0.5))
    inside = np.abs(expected) < (COLUMNS - 1) / 2
    middle = (COLUMNS - 1) / 2
    np.testing.assert_allclose((result.light[0] - middle)[inside], expected[inside], atol=1e-3)


def test_slopes_and_labels_move_with_the_image() -> None:
    result = viewed(plateau(1.0), camera_mm=21.3)
    np.testing.assert_allclose(result.slope[0], result.light[0], atol=1e-4)
    np.testing.assert_allclose(result.slope[1], -result.light[1], atol=1e-4)
    expected = np.rint(result.light[0]) + np.rint(result.light[1])
    assert np.mean(result.labels == expected) > 0.98


def test_a_camera_in_the_film_is_refused() -> None:
    with pytest.raises(InputError, match=r"camera stands 1 mm .* rises to 2 mm; raise"):
        viewed(plateau(2.0), camera_mm=1.0)
