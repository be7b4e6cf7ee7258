"""Where a lit pixel is followed by a shadow, the height may jump."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.slope.cliff_variance import cliff_variance

LED = np.array([[-30.0, 0.0, 30.0]], np.float32)
"""One LED on the left."""
EDGE = 10
"""The first column in the shadow."""


def added(light_at_the_edge: float, led: F4 = LED) -> F4:
    """The standard deviation that is added to a slope, the same in every row."""
    shadow = np.zeros((20, 20), np.uint8)
    shadow[:, EDGE:] = 1
    light = np.where(shadow, 0, light_at_the_edge).astype(np.float32)[None]
    none = np.zeros((2, 20, 20), np.float32)
    return np.sqrt(cliff_variance(none, light, shadow, led, 0.1))


def test_an_edge_in_full_light_may_be_a_step_within_a_pixel() -> None:
    deviation = added(1.0)
    np.testing.assert_allclose(deviation[:, :, EDGE - 1], 3 * 0.7, rtol=1e-5)
    near = slice(EDGE - 2, EDGE + 1)
    assert (deviation[:, :, near] > 0).all()
    assert (np.delete(deviation, near, axis=2) == 0).all()


def test_the_light_of_an_led_below_the_film_arrives_from_the_opposite_direction() -> None:
    assert np.array_equal(added(1.0, -LED), added(1.0))
    assert (added(1.0, LED * [[-1, 1, 1]]) == 0).all()


@pytest.mark.parametrize("light", [0.0, 0.1, 0.29])
def test_a_smooth_film_turns_away_from_an_led_without_a_step(light: float) -> None:
    assert (added(light) == 0).all()
