"""The equations of slopes, shadows and film at rest for the heights inside a window."""

import numpy as np
import pytest

from tactograph.nodes import ShadowRises
from tactograph.nodes.height.height_equations import STATE_AWAY, STATE_REST
from tactograph.nodes.height.integrate_weighted import integrate_weighted
from tests.nodes.error.test_height_error import stated_error
from tests.nodes.height.test_precise_nodes import PIXEL, SHAPE, at_rest, dome, equations, plateau


def test_the_window_contains_the_touch_and_a_margin() -> None:
    rest = np.ones(SHAPE, np.uint8)
    rest[20:25, 30:36] = 0
    system = equations(np.zeros((2, *SHAPE), np.float32), 1e-4, rest)
    assert system.corner.tolist() == [12, 22]
    assert system.state.shape == (21, 22)
    assert not system.state[8:13, 8:14].any()
    assert system.anchored[0]


def test_a_step_is_the_mean_slope_times_a_pixel() -> None:
    slope = np.zeros((2, *SHAPE), np.float32)
    slope[0], slope[1] = 0.3, -0.2
    system = equations(slope, 1e-4, np.zeros(SHAPE, np.uint8))
    right, down = system.steps
    assert right == pytest.approx(np.full_like(right, 0.3 * PIXEL))
    assert down == pytest.approx(np.full_like(down, -0.2 * PIXEL))
    assert np.isinf(system.right_variance[:, -1]).all()
    assert np.isinf(system.down_variance[-1]).all()


def test_pixels_outside_the_mask_are_in_no_equation() -> None:
    z, slope = dome()
    mask = np.ones(SHAPE, np.uint8)
    mask[18, 30] = 0
    rises = ShadowRises(
        np.array([18 * SHAPE[1] + 30, 18 * SHAPE[1] + 33], np.int32),
        np.array([18 * SHAPE[1] + 40, 18 * SHAPE[1] + 40], np.int32),
        np.array([0.1, 0.2], np.float32),
        np.ones(2, np.uint8),
    )
    system = equations(slope, 1e-4, at_rest(z), rises, mask)
    row, column = 18 - system.corner[0], 30 - system.corner[1]
    assert system.state[row, column] == STATE_AWAY
    assert np.isinf(system.right_variance[row, column - 1 : column + 1]).all()
    assert np.isinf(system.down_variance[row - 1 : row + 1, column]).all()
    assert system.rise.tolist() == pytest.approx([0.2])


def test_a_rise_from_outside_the_window_is_ignored() -> None:
    rest = at_rest(plateau())
    inside, outside = 20 * SHAPE[1] + 28, 0
    rises = ShadowRises(
        np.array([inside, inside], np.int32),
        np.array([outside, inside + 3], np.int32),
        np.array([0.5, 0.1], np.float32),
        np.ones(2, np.uint8),
    )
    system = equations(np.zeros((2, *SHAPE), np.float32), 1e-4, rest, rises)
    assert system.rise.tolist() == pytest.approx([0.1])
    columns = system.state.shape[1]
    assert system.top[0] == (20 - system.corner[0]) * columns + 28 - system.corner[1]


def test_a_mask_alone_leaves_no_film_at_rest() -> None:
    mask = np.ones(SHAPE, np.uint8)
    mask[:5] = 0
    rest = np.zeros(SHAPE, np.uint8)
    rest[:5] = 1
    system = equations(np.zeros((2, *SHAPE), np.float32), 1e-4, rest, mask=mask)
    assert not system.anchored[0]
    assert not (system.state == STATE_REST).any()


def test_the_rejection_of_outliers_is_the_same_for_height_and_stated_error() -> None:
    """Slopes of single pixels are wrong; both reject them, or neither does."""
    z, slope = dome()
    slope[:, np.random.default_rng(3).random(SHAPE) < 0.03] = 3
    found = []
    for robust in (2.5, 1e6):
        system = equations(slope, 1e-4, at_rest(z), bend=0.0, robust=robust)
        height = integrate_weighted(system, z)
        found.append((np.abs(height - z).mean(), stated_error(z, slope, 0.01, system=system)))
    (wrong, stated), (more_wrong, other) = found
    assert wrong < 0.2 * more_wrong
    assert np.abs(stated - other).max() > 0.1 * other.max()
