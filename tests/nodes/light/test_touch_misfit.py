"""A touch that departs from the film's model more than the calibration's presses did."""

import numpy as np
import pytest

from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4
from tactograph.nodes.light.touch_misfit import touch_misfit
from tactograph.nodes.optics.near_light import expected_light, light_vectors
from tests.nodes.scenes import LIGHTS

PIXEL, SHAPE = 0.1, (80, 90)
LEFT = np.float32([0.004, 1.0, 0.003, 0.02, 0.001])


def touch(
    departure: float | F4, noise: float = 0.0, uneven: float = 0.0, left: F4 = LEFT
) -> tuple[F4, F4, list[str]]:
    """The misfit and the warnings of a slope whose first LED, or all, are too bright."""
    rng = np.random.default_rng(1)
    slope = np.full((2, *SHAPE), 0.3, np.float32)
    height, used = np.zeros(SHAPE, np.float32), np.full(SHAPE, 15, np.uint8)
    light = expected_light(light_vectors(LIGHTS, height, PIXEL), slope)
    if isinstance(departure, float):
        light[0] += np.float32(departure)
    else:
        light *= 1 + departure
    light += rng.normal(0, noise, light.shape).astype(np.float32)
    with collect_warnings([]) as told:
        found = touch_misfit(light, slope, height, used, LIGHTS, left, PIXEL, uneven, 0 * used)
    return found, light, told


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_touch_like_the_presses_keeps_their_misfit(noise: float) -> None:
    found, _, told = touch(0.004, noise)
    assert np.array_equal(found, LEFT * np.float32([1, 1, 0, 1, 1]))
    assert not told


def test_a_larger_misfit_than_the_presses_widens_the_band_with_a_warning() -> None:
    found, _, told = touch(0.04)
    left = 0.04 / 2
    beyond = (LEFT[0] / LEFT[2]) ** 2 * (left**2 - LEFT[2] ** 2)
    # Normals have no more of it in common than they had on the presses, at least 0.3.
    tilt = np.sqrt(LEFT[4] ** 2 + 0.3**2 * beyond)
    assert found == pytest.approx([np.sqrt(LEFT[0] ** 2 + beyond), 1, 0, 0.02, tilt], rel=1e-3)
    (line,) = told
    assert "departs from the film's model by 2.0 %" in line
    assert "times as large" in line


def test_noise_alone_widens_no_band() -> None:
    """Of products of noise, half of the medians over blocks lie above zero."""
    found, *_ = touch(0.0, noise=0.02, left=np.float32([0.004, 1.0, 1e-5, 0.02, 0.001]))
    assert found[0] == pytest.approx(0.004, rel=0.01)


def test_presses_without_misfit_do_not_widen_the_band_without_bound() -> None:
    # What they left by chance is no measure of how normals err with the light.
    found, *_ = touch(0.04, left=np.float32([0.004, 1.0, 1e-5, 0.02, 0.001]))
    assert found[0] == pytest.approx(np.hypot(0.004, 1.5 * 0.04 / 2), rel=1e-3)


def test_a_brighter_film_has_little_misfit_if_its_brightness_is_unknown() -> None:
    brighter = np.full(SHAPE, 0.05, np.float32)
    known, unknown = (touch(brighter, uneven=u)[0] for u in (0.0, 0.1))
    assert known[0] > 0.03
    assert unknown[0] == pytest.approx(LEFT[0], rel=0.01)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_film_at_rest_shows_how_far_the_leds_light_departs(noise: float) -> None:
    height, slope = np.zeros(SHAPE, np.float32), np.zeros((2, *SHAPE), np.float32)
    light = expected_light(light_vectors(LIGHTS, height, PIXEL), slope)
    light[0] += np.float32(0.01)
    light += np.random.default_rng(2).normal(0, noise, light.shape).astype(np.float32)
    half = np.broadcast_to(np.arange(SHAPE[1]) < 48, SHAPE).astype(np.uint8)
    touched = (slope, height, 15 + 0 * half, LIGHTS, LEFT, PIXEL, 0.0)
    found = [touch_misfit(light, *touched, rest)[2] for rest in (half, 0 * half)]
    assert found == pytest.approx([0.01 / 2, 0], rel=0.1)
