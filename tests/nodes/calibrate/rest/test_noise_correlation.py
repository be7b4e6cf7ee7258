"""The correlation of noise between neighbouring pixels, on images with known noise."""

import tracemalloc

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.calibrate.rest.estimate_noise import estimate_noise
from tactograph.nodes.calibrate.rest.find_film import find_film
from tactograph.nodes.calibrate.rest.full_rest import full_rest
from tactograph.nodes.calibrate.rest.noise_correlation import noise_correlation

SIGMA = 0.004
SHAPE = (4, 240, 320)
FLAT = np.full(SHAPE, 0.6, np.float32)
INDEPENDENT = np.array([0, SIGMA**2], np.float32)
"""The noise of independent pixels."""


def white() -> F4:
    return np.random.default_rng(5).normal(0, SIGMA, SHAPE).astype(np.float32)


SHARED = FLAT + np.repeat(white()[..., ::2], 2, axis=-1)
"""Two pixels with the noise of one."""


def test_independent_pixels_share_no_noise() -> None:
    assert noise_correlation(FLAT + white(), FLAT, INDEPENDENT, 0.0) == pytest.approx(1, abs=0.1)


def test_noise_shared_by_two_pixels_doubles_the_variance_of_a_mean() -> None:
    assert noise_correlation(SHARED, FLAT, INDEPENDENT, 0.0) == pytest.approx(2, rel=0.15)


def test_grain_is_noise_of_a_pixel_too() -> None:
    grain = SIGMA * np.sqrt(0.75) / 0.6
    assert noise_correlation(SHARED, FLAT, INDEPENDENT / 4, grain) == pytest.approx(2, rel=0.15)


def test_no_camera_shares_more_than_a_mosaic() -> None:
    assert noise_correlation(SHARED, FLAT, INDEPENDENT / 1000, 0.0) == 4


def test_a_touch_and_the_texture_of_the_film_are_no_noise() -> None:
    y, x = np.mgrid[: SHAPE[1], : SHAPE[2]]
    texture = 1 + 0.05 * np.sin(x / 2.3) * np.sin(y / 1.9)
    touch = 1 + 0.5 * np.exp(-((x - 160) ** 2 + (y - 120) ** 2) / 40**2)
    flat = (FLAT * texture).astype(np.float32)
    image = (flat * touch).astype(np.float32) + white()
    assert noise_correlation(image, flat, INDEPENDENT, 0.0) == pytest.approx(1, abs=0.15)


def test_each_press_on_a_sheet_is_divided_by_the_flat_frame() -> None:
    sheet = np.concatenate([SHARED, SHARED], axis=1)
    one, two = (noise_correlation(light, FLAT, INDEPENDENT, 0.0) for light in (SHARED, sheet))
    assert two == pytest.approx(one, rel=0.02)


@pytest.mark.parametrize("light", [0.0, 1.0])
def test_black_and_saturated_film_gives_no_correlation(light: float) -> None:
    image = np.full(SHAPE, light, np.float32)
    assert noise_correlation(image, FLAT, INDEPENDENT, 0.0) == 1


@pytest.mark.parametrize(("rows", "columns"), [(60, 60), (31, 320), (240, 31), (5, 7)])
def test_an_image_of_few_tiles_gives_no_correlation(rows: int, columns: int) -> None:
    image = SHARED[:, :rows, :columns]
    assert noise_correlation(image, FLAT[:, :rows, :columns], INDEPENDENT, 0.0) == 1


def test_large_images_take_little_further_memory() -> None:
    """The peak memory of each function, in multiples of the image."""
    image = np.random.default_rng(0).normal(0.5, 0.01, (6, 512, 512)).astype(np.float32)
    housed, dark, small = image.copy(), 0 * image[0], image[:, ::4, ::4].copy()
    housed[:, :, :80] = 0.001
    runs = {
        3.7: lambda: estimate_noise(image),
        2.4: lambda: find_film(housed),
        1.7: lambda: noise_correlation(image, image, np.float32([0, 1e-4]), 0.0),
        1.6: lambda: full_rest(image, dark, small, 0 * small[0]),
    }
    for most, run in runs.items():
        tracemalloc.start()
        run()
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < most * image.nbytes, most
