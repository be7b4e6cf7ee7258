"""Interreflection of a film, bounce by bounce."""

import numpy as np
import pytest

from tactograph.nodes import F4, Film
from tactograph.nodes.light.film_bounce import film_bounce
from tactograph.nodes.simulate.interreflect import interreflect

PIXEL = 0.1
FAR = np.float32([[0, 0, 1e5], [2e4, 0, 1e5], [0, -3e4, 1e5]])


def imprint(depth: float = 1.2, radius: float = 4.0, side: int = 91, pixel: float = PIXEL) -> F4:
    """A ball's imprint in the film."""
    y, x = (np.indices((side, side)) - (side - 1) / 2) * pixel
    below = radius - depth - np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0))
    return np.minimum(below, 0).astype(np.float32)


def even(height: F4, level: float = 0.6) -> F4:
    return np.full((len(FAR), *height.shape), level, np.float32)


def test_bounces_inside_a_sphere_add_up_to_a_geometric_series() -> None:
    # Each bounce is the same share everywhere: albedo times the cap's part of the sphere.
    pixel, albedo = 1.5 * PIXEL, 0.8
    height = imprint(side=61, pixel=pixel)
    light = even(height)
    result = interreflect(light, light, height, FAR, pixel, albedo=albedo, cells=61 * 61)
    share = albedo * 1.2 / (2 * 4.0)
    assert result[0, 30, 30] / 0.6 == pytest.approx(1 / (1 - share), rel=0.01)


FILM = Film.matt(FAR)._replace(albedo=0.7, base=0.7)


def test_a_film_that_is_flat_or_reflects_nothing_keeps_its_light() -> None:
    light = np.random.default_rng(0).random((len(FAR), 91, 91), np.float32)
    for height, albedo in ((np.zeros((91, 91), np.float32), 0.9), (imprint(), 0.0)):
        result = interreflect(light, even(height), height, FAR, PIXEL, albedo=albedo)
        np.testing.assert_array_equal(result, light)


@pytest.mark.parametrize("alpha", [0.0, 0.3])
def test_film_bounce_recovers_the_direct_light(alpha: float) -> None:
    height = imprint()
    rng = np.random.default_rng(0)
    rest = even(height) * rng.uniform(0.9, 1.1, (len(FAR), 1, 1)).astype(np.float32)
    light = rest * np.linspace(0.2, 1.3, 91, dtype=np.float32)
    total = interreflect(light, rest, height, FAR, PIXEL, albedo=0.7, cells=2100, coat_alpha=alpha)
    assert np.abs(total - light).max() > 0.03
    film = FILM._replace(roughness=alpha, refraction=1.5) if alpha else FILM
    bounced = film_bounce(total / rest, height, film, PIXEL, cells=2100)
    np.testing.assert_allclose(total / rest - bounced, light / rest, atol=1e-3)


def test_the_foot_of_a_wall_is_never_darker_than_black() -> None:
    y, x = (np.indices((96, 128)) - np.array([[[47.5]], [[63.5]]])) * 2.5 / 14
    away = np.hypot(x, y) - 5.3
    height = np.where(away > 0, 0, 2.8 - (x * x + y * y) / 12).clip(0).astype(np.float32)
    light = even(height) * ~((x > 0) & (away > 0) & (away < 1))
    lights = np.float32([[20, 20, 36], [-20, 20, 36], [0, -30, 36]])
    result = interreflect(light, even(height), height, lights, 2.5 / 14, camera_mm=65.0)
    assert result.min() == 0
