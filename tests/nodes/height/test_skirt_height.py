"""The skirt of a touch stands above film that is held at zero; the mean of its slopes shows it."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tactograph.nodes import F4, U1
from tactograph.nodes.height.skirt_height import Skirt, skirt_height

PIXEL, NOISE = np.float32(0.08), 0.004
Y, X = np.mgrid[-90:90, -120:120] * PIXEL
RADIUS = np.hypot(X, Y)
HELD_MM = 3.0
MISFIT = np.array([0, 1, 0, 0, 2e-4], np.float32)


def skirt_of(film: F4, seed: int = 0) -> tuple[Skirt, U1]:
    """The skirt of a film that is held at zero beyond a circle, and where."""
    rest = (RADIUS > HELD_MM).astype(np.uint8)
    down, across = np.gradient(film, PIXEL)
    noise = np.random.default_rng(seed).normal(0, NOISE, (2, *film.shape))
    slope = (np.stack([across, down]) + noise).astype(np.float32)
    return skirt_height(
        slope, np.full(slope.shape, np.float32(NOISE**2)), rest, MISFIT, PIXEL
    ), rest


def tail(height_mm: float, reach_mm: float) -> F4:
    """Film that returns to rest from a height at the circle."""
    beyond = np.maximum(RADIUS - HELD_MM, 0)
    return np.asarray(height_mm * np.exp(-beyond / reach_mm), np.float32)


@settings(max_examples=15)
@given(st.floats(1.0, 5.0), st.floats(0.5, 1.8), st.sampled_from([1, -1]), st.integers(0, 99))
def test_a_skirt_is_known_within_its_stated_error(
    height_um: float, reach_mm: float, sign: int, seed: int
) -> None:
    top = sign * height_um / 1e3
    film = tail(top, reach_mm)
    found, rest = skirt_of(film, seed)
    off = np.abs(found.height - np.where(rest, film, np.float32(top)))
    assert (off < 4 * found.error + 3e-4).all()


@pytest.mark.parametrize("height_mm", [0.002, 0.004, -0.003], ids=["low", "high", "a bulge"])
@pytest.mark.parametrize("reach_mm", [0.8, 1.5])
def test_a_skirt_below_the_noise_of_a_pixel_is_measured(height_mm: float, reach_mm: float) -> None:
    """Slopes of 0.001 to 0.004 in noise of 0.004 per pixel; gel that bulges lies below zero."""
    film = tail(height_mm, reach_mm)
    found = [skirt_of(film, seed)[0].height[90, 120] for seed in range(12)]
    assert np.median(found) == pytest.approx(height_mm, rel=0.25)


def test_film_at_rest_has_hardly_a_skirt() -> None:
    found = [skirt_of(np.zeros(X.shape, np.float32), seed)[0] for seed in range(12)]
    heights = np.array([np.abs(skirt.height).max() for skirt in found])
    assert np.median(heights) < 5e-5
    assert (heights <= 2.5 * np.array([skirt.error.max() for skirt in found])).all()


def test_light_that_all_film_shares_is_no_skirt() -> None:
    """Film at rest falls by 0.0003 everywhere, as if light that a touch throws were not known.

    It may be a skirt as wide as the film nevertheless: the error says so.
    """
    dome = np.asarray(-3e-4 * RADIUS, np.float32)
    found, _ = skirt_of(dome)
    assert np.abs(found.height).max() < 3e-4
    assert found.error.max() > 5e-4


@pytest.mark.parametrize("value", [0, 1])
def test_no_film_at_rest_or_nothing_else_has_no_skirt(value: int) -> None:
    rest = np.full(X.shape, value, np.uint8)
    slope = np.full((2, *X.shape), np.float32(0.01))
    found = skirt_height(slope, slope, rest, MISFIT, PIXEL)
    assert not found.height.any()
    assert not found.error.any()


def test_slopes_that_are_not_known_do_not_count() -> None:
    film = tail(3e-3, 1.2)
    down, across = np.gradient(film, PIXEL)
    slope = np.stack([across, down]).astype(np.float32)
    variance = np.full(slope.shape, np.float32(NOISE**2))
    slope[:, :, :60], variance[:, :, :60] = 5.0, 1e12
    found = skirt_height(slope, variance, (RADIUS > HELD_MM).astype(np.uint8), MISFIT, PIXEL)
    assert found.height[90, 120] == pytest.approx(3e-3, rel=0.2)
