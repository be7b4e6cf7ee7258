"""Light that a surface explains is told apart from light that it does not."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.optics.near_light import expected_light, light_vectors
from tactograph.nodes.simulate.light_ring import light_ring
from tactograph.nodes.trust.checked_cells import NOT_TESTED
from tactograph.nodes.trust.light_departure import light_departure
from tests.nodes.scenes import waves

ROWS, COLUMNS, PIXEL = 40, 50, 0.1
SURFACE, WAVES = waves(ROWS, COLUMNS)
HEIGHT, SLOPE = SURFACE * np.float32(PIXEL / 4), WAVES / 4
MISFIT = np.array([0.003, 1, 0.004, 0.05, 0.002], np.float32)


def world(count: int) -> tuple[F4, F4]:
    """So many LEDs around the film: their places, and the light vectors of a touch."""
    lights = light_ring(count=count, slant_deg=35.0, distance_mm=40.0)
    return lights, light_vectors(lights, HEIGHT, PIXEL)


def explained(light: F4, error: F4, vectors: F4) -> F4:
    """The slopes that explain the light best, by Gauss-Newton."""
    slope = SLOPE.astype(np.float64)
    for _ in range(4):
        shown = expected_light(vectors, slope)
        step = 1e-2 * np.eye(2)[:, :, None, None]
        bent = [(expected_light(vectors, slope + s) - shown) / (1e-2 * error) for s in step]
        left = (light - shown) / error
        a, b, c = ((bent[i] * bent[j]).sum(axis=0) for i, j in ((0, 0), (0, 1), (1, 1)))
        d, e = ((bend * left).sum(axis=0) for bend in bent)
        slope += np.stack([c * d - b * e, a * e - b * d]) / (a * c - b * b)
    return slope.astype(np.float32)


def departure(light: F4, sigma: F4, slope: F4, lights: F4, **given: object) -> F4:
    used = np.full((ROWS, COLUMNS), (1 << len(light)) - 1, np.uint8)
    known = {"used": used, "misfit": MISFIT, "pixel": PIXEL, "uneven": 0.0, **given}
    return light_departure(light, sigma, slope, HEIGHT, lights=lights, **known).departure


@pytest.mark.parametrize("count", [3, 4, 8])
@pytest.mark.parametrize("noise", [0.001, 0.01, 0.05])
def test_light_of_known_shapes_departs_by_noise_whatever_that_is(count: int, noise: float) -> None:
    """Of both: the camera's noise, and the model's error that grows with the light."""
    lights, vectors = world(count)
    shown = expected_light(vectors, SLOPE)
    error = np.hypot(noise, MISFIT[2] * shown)
    light = shown + error * np.random.default_rng(count).normal(size=shown.shape)
    slope = explained(light, error, vectors)
    sigma = np.full(light.shape, noise, np.float32)
    found = departure(light.astype(np.float32), sigma, slope, lights)
    assert found.mean() == pytest.approx(1, abs=0.1)


def test_cells_have_less_noise_than_their_pixels() -> None:
    lights, vectors = world(4)
    light = expected_light(vectors, SLOPE) + np.float32(0.01)
    sigma = np.full(light.shape, 0.08, np.float32)
    of_pixels, of_cells = (
        departure(light, sigma / side, SLOPE, lights, cell_px=cell)
        for side, cell in ((4, 1), (1, 4))
    )
    np.testing.assert_allclose(of_cells, of_pixels, rtol=1e-5)


def test_a_pair_of_leds_tests_nothing() -> None:
    lights, vectors = world(4)
    light = 3 * expected_light(vectors, SLOPE)
    pair = np.full((ROWS, COLUMNS), 0b0101, np.uint8)
    sigma = np.full(light.shape, 0.01, np.float32)
    assert (departure(light, sigma, SLOPE, lights, used=pair) == NOT_TESTED).all()
    assert (departure(light, sigma, SLOPE, lights, used=0 * pair) == NOT_TESTED).all()


def test_three_leds_and_a_brightness_that_may_be_any_test_nothing() -> None:
    lights, vectors = world(3)
    light, sigma = expected_light(vectors, SLOPE), np.full((3, ROWS, COLUMNS), 1e-3, np.float32)
    assert (departure(light, sigma, SLOPE, lights, uneven=0.05) == NOT_TESTED).all()
    assert (departure(light, sigma, SLOPE, lights, uneven=0.0) >= 0).all()


def test_an_unknown_brightness_is_no_departure() -> None:
    lights, vectors = world(4)
    brighter = expected_light(vectors, SLOPE) * np.float32(1.05)
    sigma = np.full(brighter.shape, 0.002, np.float32)
    assert departure(brighter, sigma, SLOPE, lights, uneven=0.05).max() < 2
    assert departure(brighter, sigma, SLOPE, lights, uneven=0.0).min() > 50
    used = np.full((ROWS, COLUMNS), 15, np.uint8)
    found = light_departure(brighter, sigma, SLOPE, HEIGHT, used, lights, MISFIT, PIXEL, 0.05)
    np.testing.assert_allclose(found.brighter, 0.05, atol=1e-5)


def test_an_led_that_is_wrong_shows_unless_it_is_left_out() -> None:
    lights, vectors = world(5)
    light = expected_light(vectors, SLOPE)
    light[1] *= np.float32(0.8)
    sigma = np.full(light.shape, 0.005, np.float32)
    others = np.full((ROWS, COLUMNS), 0b11101, np.uint8)
    assert np.median(departure(light, sigma, SLOPE, lights)) > 50
    assert departure(light, sigma, SLOPE, lights, used=others).max() < 0.01


@pytest.mark.parametrize("shape", [(1, 7), (7, 1), (1, 1)])
def test_an_image_of_one_row_is_tested_too(shape: tuple[int, int]) -> None:
    lights, flat = world(4)[0], np.zeros(shape, np.float32)
    light = np.ones((4, *shape), np.float32)
    all_used, level = np.full(shape, 15, np.uint8), np.zeros((2, *shape), np.float32)
    found = light_departure(light, 0 * light, level, flat, all_used, lights, MISFIT, PIXEL, 0.0)
    for plane in found:
        assert plane.shape == shape
        assert np.abs(plane).max() < 1e-3


def test_no_model_is_taken_for_exact() -> None:
    lights, vectors = world(4)
    light = expected_light(vectors, SLOPE) * (
        1 + np.float32(0.001) * np.float32([1, -1, -1, 1])[:, None, None]
    )
    stated = MISFIT * np.float32([1, 1, 0, 1, 1])
    assert departure(light, 0 * light, SLOPE, lights, misfit=stated).max() < 2
