"""Film at rest is the fingerprint of a sensor: faded LEDs pass, others are told."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.simulate.light_ring import light_ring
from tactograph.nodes.trust._check import Check
from tactograph.nodes.trust._rest_check import check_rest
from tactograph.nodes.trust._rest_evidence import rest_evidence
from tactograph.nodes.trust.added_light import added_light

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


def told(
    light: F4,
    drift: F4 | None = None,
    height: F4 | None = None,
    lights: F4 | None = None,
    flat: F4 | None = None,
) -> Check:
    level, film = rest_evidence(light, risen() if height is None else height, drift)
    added = 0.0 if flat is None else added_light(light, flat)
    return check_rest(level, film, lights, added)


@pytest.mark.parametrize("found", [True, False], ids=["drift found", "drift not looked for"])
def test_leds_that_faded_a_little_pass(found: bool) -> None:
    """Where no drift is taken out, less of it passes: it stays in the height."""
    levels = (0.96, 0.93, 0.95, 0.94) if found else (0.98, 0.975, 0.99, 1.02)
    assert told(scaled(pressed(), *levels), drifted(*levels) if found else None).figure < 0.75


@pytest.mark.parametrize("found", [True, False], ids=["drift found", "drift not looked for"])
@pytest.mark.parametrize(("level", "sense"), [(0.88, "darker"), (1.14, "brighter")])
def test_an_led_changed_by_over_a_tenth_is_named(found: bool, level: float, sense: str) -> None:
    levels = (1.0, 1.0, level, 1.0)
    check = told(scaled(pressed(), *levels), drifted(*levels) if found else None)
    assert check.figure > 1
    assert str(check).startswith(f"LED 3 is {sense} than in the calibration")


def changed(*levels: float) -> tuple[F4, F4]:
    """A touch whose LEDs have changed, and that drift."""
    return scaled(pressed(), *levels), drifted(*levels)


@pytest.mark.parametrize(
    ("given", "figure", "said"),
    [
        (changed(0.15, 0.15, 0.15, 0.15), 8.5, "check exposure"),
        # 2 % of full scale, where the film has half of it: 16 % of a height by `paper`.
        ((pressed() + np.float32(0.042),), None, "other light is kept out"),
        (changed(0.92, 1.09, 1.0, 1.0), None, "reaches all borders"),
        ((pressed(), None, risen(0.0, -1.0)), None, "below the film at rest"),
    ],
    ids=["all LEDs darker", "other light", "LEDs that change apart", "a touch below the film"],
)
def test_what_is_wrong_is_told(given: tuple[F4, ...], figure: float | None, said: str) -> None:
    check = told(*given)
    assert check.figure > 1
    assert figure is None or check.figure == pytest.approx(figure, abs=0.1)
    assert said in str(check)


def test_light_that_is_spread_otherwise_is_told() -> None:
    ramp = 1 + 0.06 * np.linspace(-1, 1, SHAPE[1], dtype=np.float32)
    check = told(pressed() * ramp, drifted(1.0001, 1, 1, 1, tilt=0.06))
    assert check.figure == pytest.approx(0.06 / 0.045, rel=1e-3)
    assert "spread otherwise" in str(check)


def test_black_images_are_told_but_not_a_black_shadow_of_one_led() -> None:
    """Without dividing by them."""
    half, shadow = pressed(), pressed()
    half[:, 15:] = 0
    shadow[0, 9:20, 12:25] = 0
    for light, height in ((half, risen()), (0 * half, np.zeros(SHAPE, np.float32))):
        check = told(light, height=height)
        assert 1 < check.figure < np.inf
        assert "without light" in str(check)
    for light, drift in ((shadow, None), (pressed(), None), (pressed(), drifted(1, 1, 1, 1))):
        assert told(light, drift).figure < 0.3


def test_a_surface_touched_everywhere_says_that_zero_and_tilt_are_unknown() -> None:
    wave = 1 + 0.7 * np.sin(np.arange(SHAPE[1]) * 0.9)
    check = told((np.ones((4, *SHAPE)) * wave).astype(np.float32))
    assert check.figure > 1.5
    assert "zero and tilt of the height are unknown" in str(check)


def test_leds_that_change_as_if_the_film_was_tilted_are_told_where_nothing_else_shows() -> None:
    """A plate that tilts the whole film; beside a touch, LEDs may fade as they like."""
    lights = light_ring(count=4, slant_deg=35.0, distance_mm=40.0)
    levels = 1 + 0.1 * lights[:, 0] / lights[:, 2]
    light, drift = scaled(np.ones((4, *SHAPE), np.float32), *levels), drifted(*levels)
    flat = np.zeros(SHAPE, np.float32)
    check = told(light, drift, flat, lights)
    assert check.figure > 1
    assert "the whole film was tilted" in str(check)
    assert told(light, drift, lights=lights).figure < 1
    alike = drifted(1.05, 1.05, 1.05, 1.05)
    even = scaled(light / levels[:, None, None], *alike[:, 0])
    assert told(even, alike, flat, lights).figure < 1


@pytest.mark.parametrize(
    "height", [risen(-0.3, 1.0), risen(0.0, -0.02)], ids=["skirt", "untouched"]
)
def test_film_that_gives_way_beside_a_touch_or_is_at_rest_passes(height: F4) -> None:
    assert told(pressed(), height=height).figure < 0.75


@pytest.mark.parametrize("shape", [(1, 9), (9, 1), (1, 1)])
def test_an_image_of_one_row_has_a_film_at_rest_too(shape: tuple[int, int]) -> None:
    check = told(np.ones((4, *shape), np.float32), height=np.zeros(shape, np.float32))
    assert check.figure < 0.3


FALLING = np.linspace(0.25, 0.7, SHAPE[1], dtype=np.float32)
UNEVEN = np.stack([np.broadcast_to(f, SHAPE) for f in (FALLING, FALLING[::-1], 0.6 * FALLING)])
"""Film at rest under three LEDs."""


@pytest.mark.parametrize("added", [0.015, -0.015])
def test_light_that_was_added_everywhere_is_told_and_leds_that_faded_are_not(added: float) -> None:
    faded = scaled(pressed()[:3], 0.98, 1.02, 0.99)
    levels = drifted(1, 1, 1)
    assert told(faded, levels, flat=UNEVEN).figure < 0.5
    assert told(faded + np.float32(added) / UNEVEN, levels).figure < 1
    check = told(faded + np.float32(added) / UNEVEN, levels, flat=UNEVEN)
    assert check.figure > 1
    assert ("added" if added > 0 else "lacks light") in str(check)


def test_film_that_is_equally_bright_everywhere_tells_no_added_light() -> None:
    """There light that was added is an LED that is brighter."""
    even = np.full_like(UNEVEN, 0.5)
    check = told(pressed()[:3] + np.float32(0.03), drifted(1, 1, 1), flat=even)
    assert "added" not in str(check)
