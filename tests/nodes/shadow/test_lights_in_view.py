"""Shadows in the view of a near camera end where the film's shadows appear to end."""

import numpy as np
import pytest

from tactograph.nodes.shadow.cast_shadows import cast_shadows
from tactograph.nodes.shadow.lights_in_view import lights_in_view
from tests.nodes.films import LEDS

CAMERA = 1 / 65


def test_the_end_of_a_shadow_lies_on_the_line_from_the_led_in_view() -> None:
    edge, foot = np.array([3.0, -2.0, 1.5]), 0.4
    for led, apparent_led in zip(LEDS, lights_in_view(LEDS, CAMERA), strict=True):
        end = edge + (edge - led) * (edge[2] - foot) / (led[2] - edge[2])
        assert end[2] == pytest.approx(foot)
        apparent_edge, apparent_end = (p / (1 - CAMERA * p[2]) for p in (edge, end))
        share = (apparent_led[2] - apparent_end[2]) / (apparent_led[2] - apparent_edge[2])
        assert apparent_led + share * (apparent_edge - apparent_led) == pytest.approx(
            apparent_end, abs=1e-3
        )


@pytest.mark.parametrize("led_z", [30, 90, 200])
def test_the_shadow_of_a_wall_has_its_apparent_length(led_z: float) -> None:
    """A wall 1.5 mm high across the view; its shadow ends on the film at rest, straight ahead.

    Two of the LEDs are higher than the pupil.
    """
    pixel, z, led = 0.05, 1.5, np.float32([[-2 / 3 * led_z, 0.0, led_z]])
    x = (np.arange(400) - 199.5) * pixel
    apparent = z / (1 - CAMERA * z)
    wall = (x > 6.8) & (x < 7)
    height = np.repeat(np.where(wall, apparent, 0).astype(np.float32)[None], 9, axis=0)
    edge_x = x[wall].max() * (1 - CAMERA * z)
    end = edge_x + (edge_x - led[0, 0]) * z / (led_z - z)
    for lights, right in ((lights_in_view(led, CAMERA), True), (led, False)):
        dark = cast_shadows(height, lights, pixel)[4] == 1
        last = x[dark].max()
        assert (abs(last - end) < 1.5 * pixel) == right


def test_an_led_as_high_as_the_pupil_is_far_away() -> None:
    level = np.float32([[30.0, 0.0, 65.0], [30.0, 0.0, 65.001]])
    assert (abs(lights_in_view(level, CAMERA)[:, 2]) > 1000).all()


def test_a_camera_far_away_changes_nothing() -> None:
    assert np.array_equal(lights_in_view(LEDS, 0.0), LEDS)
