"""In the view of a near camera shadows end where the film's shadows appear to end."""

import numpy as np
import pytest

from tactograph.nodes.shadow.cast_shadows import cast_shadows
from tactograph.nodes.shadow.lights_in_view import lights_in_view
from tests.nodes.films import LEDS

CAMERA = 1 / 65


def test_a_shadow_ends_on_the_line_from_the_led_in_view() -> None:
    edge, foot = np.array([3.0, -2.0, 1.5]), 0.4
    for led, seen_led in zip(LEDS, lights_in_view(LEDS, CAMERA), strict=True):
        end = edge + (edge - led) * (edge[2] - foot) / (led[2] - edge[2])
        assert end[2] == pytest.approx(foot)
        seen_edge, seen_end = (p / (1 - CAMERA * p[2]) for p in (edge, end))
        share = (seen_led[2] - seen_end[2]) / (seen_led[2] - seen_edge[2])
        assert seen_led + share * (seen_edge - seen_led) == pytest.approx(seen_end, abs=1e-3)


def test_the_shadow_of_a_wall_has_its_length_in_view() -> None:
    """A wall 1.5 mm high across the view; its shadow ends on the film at rest, straight ahead."""
    pixel, z, led = 0.05, 1.5, np.float32([[-20.0, 0.0, 30.0]])
    x = (np.arange(400) - 199.5) * pixel
    seen = z / (1 - CAMERA * z)
    wall = (x > 6.8) & (x < 7)
    height = np.repeat(np.where(wall, seen, 0).astype(np.float32)[None], 9, axis=0)
    edge_x = x[wall].max() * (1 - CAMERA * z)
    end = edge_x + (edge_x + 20) * z / (30 - z)
    for lights, right in ((lights_in_view(led, CAMERA), True), (led, False)):
        dark = cast_shadows(height, lights, pixel)[4] == 1
        last = x[dark].max()
        assert (abs(last - end) < 1.5 * pixel) == right


def test_an_led_at_the_height_of_the_pupil_is_far_away() -> None:
    level = np.float32([[30.0, 0.0, 65.0], [30.0, 0.0, 80.0]])
    found = lights_in_view(level, CAMERA)
    assert (found[:, 2] > 1000).all()


def test_a_camera_far_away_changes_nothing() -> None:
    assert np.array_equal(lights_in_view(LEDS, 0.0), LEDS)
