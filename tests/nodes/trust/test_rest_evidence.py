"""Film at rest is the fingerprint of a sensor: its figures, and light that was added."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.trust.explained import added_share
from tactograph.nodes.trust.touch_evidence import touch_evidence
from tests.nodes.trust.law import by_name

SHAPE = (30, 40)
TOUCHED = np.s_[:, 8:22, 10:30]


def pressed(noise: float = 0.003) -> F4:
    """Four LEDs' light: 1 but for noise, and a touch that changes it by half."""
    light = 1 + np.random.default_rng(1).normal(0, noise, (4, *SHAPE))
    light[TOUCHED] *= np.array([1.5, 1.2, 0.6, 0.8])[:, None, None]
    return light.astype(np.float32)


def risen(lowest: float = 0.0, highest: float = 1.0) -> F4:
    height = np.full(SHAPE, lowest, np.float32)
    height[TOUCHED[1:]] = highest
    return height


def drifted(*levels: float, tilt: float = 0.0) -> F4:
    drift = np.zeros((len(levels), 6), np.float32)
    drift[:, 0], drift[:, 1] = levels, tilt
    return drift


def scaled(light: F4, *levels: float) -> F4:
    return light * np.array(levels, np.float32)[:, None, None]


UNTESTED = np.full(SHAPE, -1, np.float32)


def figures(light: F4, drift: F4 | None = None, height: F4 | None = None) -> dict[str, float]:
    return by_name(touch_evidence(UNTESTED, light, risen() if height is None else height, drift))


def added_light(light: F4, flat: F4) -> float:
    return added_share(light.reshape(len(light), -1), flat.reshape(len(flat), -1))


@pytest.mark.parametrize("found", [True, False], ids=["drift found", "drift not looked for"])
def test_the_light_of_the_film_at_rest_is_that_of_the_calibration(found: bool) -> None:
    levels = (1.0, 1.0, 0.88, 1.0)
    seen = figures(scaled(pressed(), *levels), drifted(*levels) if found else None)
    assert seen["level"] == pytest.approx(0.06, abs=2e-3)
    alike = figures(scaled(pressed(), *[0.88] * 4))
    assert alike["level"] == pytest.approx(0.12, abs=2e-3)


def test_a_different_distribution_of_light_is_found() -> None:
    ramp = 1 + 0.06 * np.linspace(-1, 1, SHAPE[1], dtype=np.float32)
    seen = figures(pressed() * ramp, drifted(1.0001, 1, 1, 1, tilt=0.06))
    assert seen["shape"] == pytest.approx(0.06)


def test_black_images_are_seen_but_not_a_black_shadow_of_one_led() -> None:
    """Without dividing by them."""
    half, shadow = pressed(), pressed()
    half[:, 15:] = 0
    shadow[0, 9:20, 12:25] = 0
    assert figures(half)["dark_share"] == 0.5
    nothing = figures(0 * half)
    assert nothing["dark_share"] == 1
    assert np.isfinite([*nothing.values()]).all()
    assert figures(0.03 * pressed())["dark_share"] == 0, "exposed too short, not cut off"
    for drift in (None, drifted(1, 1, 1, 1)):
        assert figures(shadow, drift)["dark_share"] == 0


def test_a_surface_touched_everywhere_leaves_no_film_at_rest() -> None:
    wave = 1 + 0.7 * np.sin(np.arange(SHAPE[1]) * 0.9)
    assert figures((np.ones((4, *SHAPE)) * wave).astype(np.float32))["touched_share"] > 0.8
    assert figures(pressed())["touched_share"] < 0.3


def test_a_touch_below_the_film_is_as_deep_as_it_is_high() -> None:
    assert figures(pressed(), height=risen(-0.3, 1.0))["depth"] == pytest.approx(0.3)
    assert figures(pressed(), height=risen(0.0, -1.0))["depth"] > 5
    assert figures(pressed(), height=risen(0.0, -0.02))["depth"] < 0.2, "untouched film"


FALLING = np.linspace(0.25, 0.7, SHAPE[1], dtype=np.float32)
UNEVEN = np.stack([np.broadcast_to(f, SHAPE) for f in (FALLING, FALLING[::-1], 0.6 * FALLING)])
"""Film at rest under three LEDs."""


@pytest.mark.parametrize("added", [0.015, -0.015])
def test_uniformly_added_light_is_found_and_fading_leds_are_not_mistaken_for_it(
    added: float,
) -> None:
    faded = scaled(pressed()[:3], 0.98, 1.02, 0.99)
    assert abs(added_light(faded, UNEVEN)) < 0.005
    seen = added_light(faded + np.float32(added) / UNEVEN, UNEVEN)
    assert abs(seen) > 0.02
    assert (seen > 0) == (added > 0)


def test_uniformly_bright_film_shows_no_added_light() -> None:
    """There light that was added is an LED that is brighter."""
    even = np.full_like(UNEVEN, 0.5)
    assert added_light(pressed()[:3] + np.float32(0.03), even) == 0
