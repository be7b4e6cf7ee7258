"""What a one-shot sensor's three colours leave to check a slope by."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.rings.oneshot.nodes.map.map_departure import map_departure
from tactograph.rings.oneshot.nodes.map.mapped_light import mapped_light
from tactograph.rings.oneshot.nodes.map.reflectance_map import PLACE_TERMS, SHADE_COUNT
from tactograph.rings.oneshot.nodes.map.solve_reflectance_map import solve_reflectance_map
from tests.nodes.scenes import waves

SHAPE = (40, 50)
SURFACE, WAVES = waves(*SHAPE)
HEIGHT, SLOPE = SURFACE / 40, WAVES / 2
FLAT = np.full((4, *SHAPE), 0.4, np.float32)


def reflectance(count: int) -> F4:
    """Lights from all sides, brighter where the film is raised."""
    azimuth = 0.3 + 2 * np.pi * np.arange(count) / count
    found = np.zeros((count, SHADE_COUNT, PLACE_TERMS), np.float32)
    found[:, 0, 0], found[:, 1, 0], found[:, 2, 0] = (
        0.7 * np.cos(azimuth),
        0.7 * np.sin(azimuth),
        0.9,
    )
    found[:, 0, 1], found[:, 8, 0] = 0.1, 0.2
    return found


def departure(light: F4, error: float) -> F4:
    """Of the slopes that explain the light best."""
    known, flat = reflectance(len(light)), FLAT[: len(light)]
    slope = solve_reflectance_map(light, flat, HEIGHT, known, prior=1e-6)
    misfit = np.array([0, 0, error, 0, 0], np.float32)
    return map_departure(light, slope, HEIGHT, known, misfit).departure


def lit(count: int, noise: float = 0.0) -> F4:
    light = mapped_light(SLOPE, HEIGHT, reflectance(count))
    return (light + np.random.default_rng(2).normal(0, noise, light.shape)).astype(np.float32)


@pytest.mark.parametrize("count", [3, 4])
@pytest.mark.parametrize("noise", [0.008, 0.03])
def test_light_of_known_shapes_departs_by_the_calibrations_misfit(count: int, noise: float) -> None:
    assert departure(lit(count, noise), noise).mean() == pytest.approx(1, abs=0.1)


def test_colours_in_another_order_are_those_of_no_surface() -> None:
    assert np.median(departure(lit(3), 0.005)) < 0.01
    assert np.median(departure(lit(3)[[1, 0, 2]] * np.float32([[[1.1]]]), 0.005)) > 4


def test_no_map_is_taken_for_exact() -> None:
    assert departure(lit(3, 0.003), 0.0).mean() < 10


@pytest.mark.parametrize("shape", [(1, 6), (6, 1), (1, 1)])
def test_an_image_of_one_row_is_tested_too(shape: tuple[int, int]) -> None:
    light, level = np.ones((3, *shape), np.float32), np.zeros((2, *shape), np.float32)
    found = map_departure(light, level, level[0], reflectance(3), np.zeros(5, np.float32))
    np.testing.assert_array_equal(found, np.zeros((2, *shape), np.float32))
