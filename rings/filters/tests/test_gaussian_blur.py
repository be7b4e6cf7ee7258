"""A Gaussian takes out noise and keeps the light."""

import numpy as np
import pytest

from tactograph.rings.filters.nodes.gaussian_blur import gaussian_blur


def test_two_blurs_are_one_whose_variances_add_up() -> None:
    light = np.random.default_rng(1).random((2, 60, 60), np.float32)
    twice = gaussian_blur(gaussian_blur(light, sigma=1.5), sigma=2.0)
    once = gaussian_blur(light, sigma=2.5)
    assert np.abs(twice - once)[:, 20:-20, 20:-20].max() < 3e-4


def test_the_light_of_one_led_does_not_reach_that_of_another() -> None:
    light = np.zeros((2, 9, 9), np.float32)
    light[0] = 1
    assert gaussian_blur(light, sigma=2.0)[1].max() == 0


@pytest.mark.parametrize("border", ["replicate", "reflect", "reflect_101"])
def test_even_light_stays_even_up_to_the_border(border: str) -> None:
    light = np.full((1, 7, 5), 0.25, np.float32)
    np.testing.assert_allclose(gaussian_blur(light, sigma=4.0, border=border), 0.25, rtol=1e-6)


def test_reflection_about_the_border_keeps_the_sum_of_the_light() -> None:
    light = np.random.default_rng(1).random((1, 30, 20), np.float32)
    blurred = gaussian_blur(light, sigma=3.0, border="reflect")
    assert blurred.sum() == pytest.approx(light.sum(), rel=1e-4)
