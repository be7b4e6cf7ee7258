"""A drift that looks like the slopes of one surface is a skirt; any other is of the LEDs."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tactograph.nodes import F4
from tactograph.nodes.light.film_drift import drift_gain, terms
from tactograph.nodes.light.spare_skirt import Spared, spare_skirt
from tactograph.nodes.optics.near_light import image_places, lights_around

SHAPE, PIXEL = (30, 40), np.float32(0.4)
X, Y = image_places(SHAPE, float(PIXEL))


def leds(seed: int, count: int = 4) -> F4:
    return lights_around(np.random.default_rng(seed), count)


def spared(drift: F4, lights: F4) -> Spared:
    return spare_skirt(drift, lights, PIXEL, np.ones((len(lights), *SHAPE), np.float32))


def drift_of(film: F4, lights: F4) -> F4:
    """The light that the slopes of a film change, as a drift."""
    down, across = np.gradient(film, float(PIXEL))
    x, y, z = lights.T[:, :, None, None]
    light = 1 + across * (X - x) / z + down * (Y - y) / z
    basis = terms(SHAPE).reshape(6, -1)
    return np.linalg.lstsq(basis.T, light.reshape(len(lights), -1).T)[0].T.astype(np.float32)


def drifts(rng: np.random.Generator, count: int = 4) -> F4:
    """Each LED's level changes by a per cent, and its light's shape, of any kind, by a tenth."""
    basis = terms(SHAPE).reshape(6, -1)
    _, to_terms = np.linalg.qr(basis.T)
    changes = rng.normal(0, 1e-3 * np.sqrt(X.size * Y.size), (6, count))
    drift = np.linalg.solve(to_terms, changes).T.astype(np.float32)
    drift[:, 0] += 1 + rng.normal(0, 0.01, count)
    return drift


@pytest.mark.parametrize("count", [3, 4, 6])
@settings(max_examples=10)
@given(
    reach=st.floats(4, 8), x=st.floats(-3, 3), y=st.floats(-3, 3), seed=st.integers(0, 99),
    depth=st.sampled_from([-0.01, 0.01, 0.05]),
)  # fmt: skip
def test_a_skirt_as_wide_as_the_frame_stays_in_the_light(
    count: int, reach: float, x: float, y: float, seed: int, depth: float
) -> None:
    lights = leds(seed, count)
    film = depth * np.exp(-((X - x) ** 2 + (Y - y) ** 2) / (2 * reach**2))
    before = drift_of(film, lights)
    after = spared(before, lights).drift
    uneven = [drift_gain(each, SHAPE).std(axis=(1, 2)) for each in (before, after)]
    assert (uneven[1] < 0.6 * uneven[0]).all()


def test_drift_of_the_leds_is_a_skirt_once_in_a_hundred_times() -> None:
    found = 0
    for seed in range(1000):
        drift = drifts(np.random.default_rng(seed))
        after, surface = spared(drift, leds(seed))
        assert (after == drift).all() or surface.any()
        found += surface.any()
    assert 2 <= found <= 20


def test_a_skirt_is_found_beside_drift() -> None:
    film = 0.1 * np.exp(-(X * X + Y * Y) / 50)
    lights, left = leds(0), []
    for seed in range(20):
        drift = drifts(np.random.default_rng(seed))
        after = spared(drift + drift_of(film, lights) - np.eye(1, 6, dtype=np.float32), lights)[0]
        left.append((drift_gain(after, SHAPE) - drift_gain(drift, SHAPE)).std())
    alone = (drift_gain(drift_of(film, lights), SHAPE)).std()
    assert np.median(left) < 0.5 * alone


@pytest.mark.parametrize("changed", [0.0, 0.02])
def test_leds_that_fade_evenly_hide_no_skirt(changed: float) -> None:
    drift = np.zeros((4, 6), np.float32)
    drift[:, 0] = 1 - changed * np.arange(4)
    after, surface = spared(drift, leds(0))
    assert (after == drift).all()
    assert not surface.any()


def test_one_led_cannot_tell() -> None:
    assert not spared(np.ones((1, 6), np.float32), leds(0, 1)).surface.any()
