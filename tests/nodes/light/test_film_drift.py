"""LEDs fade: the film at rest reveals it, and no touch still means no height."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.special import fdtrc

from tactograph.graph import Provenance, load
from tactograph.nodes import F4, Film
from tactograph.nodes.calibrate.file.calibration import NO_MISFIT
from tactograph.nodes.calibrate.file.write_calibration import write_calibration
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.light.film_drift import SLOPE_COMPONENTS, _chance, film_drift, terms
from tactograph.nodes.light.flat_field import flat_field
from tactograph.nodes.light.level_light import level_light
from tactograph.nodes.simulate.light_ring import light_ring
from tactograph.nodes.simulate.render import render

SIZE = (48, 64)
SIGMA = 0.004
NOISE = np.full((4, *SIZE), SIGMA, np.float32)
FADED = np.array([0.95, 1.0, 1.02, 0.99], np.float32)
TOWARDS = ((1, 1), (-1, 1), (-1, -1), (1, -1))
AROUND = np.array([[20 * x, 20 * y, 35] for x, y in TOWARDS], np.float32)
"""Four LEDs in mm."""


def film(gain: F4 | float = 1.0, seed: int = 0, count: int = 4) -> F4:
    rng = np.random.default_rng(seed)
    light = np.broadcast_to(gain, (count, *SIZE)) + rng.normal(0, SIGMA, (count, *SIZE))
    return light.astype(np.float32)


def touched(light: F4) -> F4:
    """The same light with a touch in the middle of the frame."""
    pressed = light.copy()
    rows, columns = pressed[:, 8:40, 16:48].shape[1:]
    y, x = np.mgrid[-1 : 1 : rows * 1j, -1 : 1 : columns * 1j]
    for k, (p, q) in enumerate(TOWARDS):
        pressed[k, 8:40, 16:48] *= 1 + 0.4 * (p * x + q * y)
    return pressed


def drift(light: F4, **settings) -> F4:
    return film_drift(coarsen(light), coarsen(NOISE), grain=0.0, **settings)


def shaped(drift: F4) -> F4:
    basis = terms(SIZE)
    return np.tensordot(drift, basis, axes=1)


def test_a_fade_is_found_around_a_touch() -> None:
    fitted = drift(touched(film(FADED[:, None, None])))
    assert fitted[:, 0] == pytest.approx(FADED, abs=1e-3)
    assert not fitted[:, 1:].any()


def test_where_nothing_drifts_nothing_is_changed() -> None:
    light = touched(film())
    fitted = drift(light)
    assert fitted[:, 0].tolist() == [1, 1, 1, 1]
    assert np.array_equal(level_light(light, fitted), light)


@pytest.mark.parametrize("degree", [0, 2])
def test_flat_field_with_a_drift_equals_flat_field_and_then_level_light(degree: int) -> None:
    rng = np.random.default_rng(0)
    image, flat = rng.uniform(0.2, 0.8, (2, 4, *SIZE)).astype(np.float32)
    dark = rng.uniform(0, 0.02, SIZE).astype(np.float32)
    faded = np.zeros((4, 6), np.float32)
    faded[:, 0] = FADED
    if degree:
        faded[:, 1:] = rng.uniform(-0.02, 0.02, (4, 5))
    np.testing.assert_allclose(
        flat_field(image, flat, dark, faded),
        level_light(flat_field(image, flat, dark), faded),
        rtol=1e-6,
    )


def test_the_skirt_of_a_touch_is_no_drift() -> None:
    light = touched(film())
    light[:, :, 50:] *= 1 - 0.5 * SIGMA
    assert drift(light)[:, 0].tolist() == [1, 1, 1, 1]


def test_the_skirt_of_a_large_press_is_no_drift_that_varies() -> None:
    """Film comes back to rest as exp(-d / reach) around a press that fills half the frame."""
    size, reach = (240, 320), 8.0
    y, x = np.mgrid[: size[0], : size[1]] - np.array([119.5, 159.5]).reshape(2, 1, 1)
    radius = np.maximum(np.hypot(x, y), 1.0)
    steep = np.float32(0.5) * np.exp(-np.maximum(radius - 70, 0) / reach)
    rng = np.random.default_rng(0)
    noise = np.full((4, *size), 0.01, np.float32)
    light = rng.normal(1, noise).astype(np.float32)
    for k, (p, q) in enumerate(TOWARDS):
        light[k] += steep * (p * x + q * y) / radius + (1 + p) * 0.1 * steep
    fitted = film_drift(coarsen(light), coarsen(noise), degree=2, grain=0.0)
    basis = terms((60, 80))
    assert np.abs(np.tensordot(fitted, basis, axes=1) - 1).max() < 2e-4


@pytest.mark.parametrize("count", [3, 4, 6])
def test_slopes_of_the_film_are_no_drift_of_the_leds(count: int) -> None:
    """A wide skirt falls to all sides, so its slopes look like a shape of each LED's drift."""
    lights = light_ring(count=count, slant_deg=40.0, distance_mm=300.0)
    u, v = terms(SIZE)[1:3]
    towards = -lights[:, :2, None, None] / lights[:, 2, None, None, None]
    light = film(1 + 0.004 * (towards[:, 0] * u + towards[:, 1] * v), count=count)
    cells, noise = coarsen(light), coarsen(NOISE[:1].repeat(count, axis=0))
    unaware, fitted = (
        film_drift(cells, noise, lights=known, degree=2, grain=0.0) for known in (None, lights)
    )
    assert np.abs(unaware[:, 1:]).max() > 0.002
    assert np.abs(fitted[:, 1:]).max() < 0.1 * np.abs(unaware[:, 1:]).max()


@given(st.floats(0.01, 0.99), st.integers(1, 5), st.integers(1, 6))
def test_the_chance_of_a_shape_by_drift_alone_is_that_of_an_f_test(
    rest: float, terms: int, others: int
) -> None:
    ratio = (1 - rest) / rest * others / SLOPE_COMPONENTS
    chance = fdtrc(SLOPE_COMPONENTS * terms, others * terms, ratio)
    assert _chance(rest, terms, others) == pytest.approx(chance, rel=1e-6)


@pytest.mark.parametrize("led", range(4))
def test_the_shape_of_one_leds_drift_is_drift(led: int) -> None:
    true = np.zeros((4, 6), np.float32)
    true[:, 0], true[led, 1], true[led, 5] = FADED, 0.02, -0.01
    fitted = drift(film(shaped(true)), lights=AROUND, degree=2)
    assert np.abs(shaped(fitted) - shaped(true)).max() < 3e-3


def hanging(*, tilt: float = 0.0) -> F4:
    """Film that hangs between pins, and is tilted: a mean of cells departs like each of them."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(np.float32)
    p, q = (0.016 * np.sin(2 * np.pi * along / 16) for along in (x + 0.3 * y, y))
    p += tilt + 0.004 * x / SIZE[1]
    return np.stack([1 + a * p + b * q for a, b in TOWARDS]).astype(np.float32)


HANGING_NOISE = np.full((4, *SIZE), 0.02, np.float32)


@pytest.mark.parametrize("lights", [None, AROUND], ids=["unknown", "known"])
def test_skirts_all_over_the_frame_are_no_drift(lights: F4 | None) -> None:
    options = {"lights": lights, "degree": 2, "grain": 0.0}
    kept = film_drift(hanging(), HANGING_NOISE, **options)
    assert kept[:, 0].tolist() == [1, 1, 1, 1]
    assert not kept[:, 1:].any()
    # A change that no calm cell departs by is followed nevertheless.
    faded = FADED.copy()
    faded[1] = 0.9
    found = film_drift(hanging() * faded[:, None, None], HANGING_NOISE, **options)
    assert found[:2, 0] == pytest.approx(faded[:2], abs=0.005)
    assert found[2:, 0].tolist() == [1, 1]


def test_between_skirts_all_leds_may_brighten_but_a_tilt_is_no_drift() -> None:
    brighter = np.array([1.05, 1.065, 1.06, 1.055], np.float32)
    found, tilted = (
        film_drift(light, HANGING_NOISE, lights=AROUND, degree=2, grain=0.0)
        for light in (hanging() * brighter[:, None, None], hanging(tilt=0.04))
    )
    assert found[:, 0] == pytest.approx(brighter, abs=0.005)
    assert tilted[:, 0].tolist() == [1, 1, 1, 1]


def test_the_flat_frames_noise_makes_a_drift_doubtful_too() -> None:
    light = np.full((4, *SIZE), 1 - 5.5 * SIGMA / np.sqrt(np.prod(SIZE)), np.float32)
    assert (drift(light, flat_noise=0.0)[:, 0] < 1).all()
    assert drift(light)[:, 0].tolist() == [1, 1, 1, 1]


def test_a_film_that_is_touched_everywhere_keeps_the_previous_drift() -> None:
    before = np.zeros((4, 6), np.float32)
    before[:, 0] = FADED
    light = np.random.default_rng(0).uniform(0, 2, (4, *SIZE)).astype(np.float32)
    assert np.array_equal(film_drift(coarsen(light), coarsen(NOISE), before), before)


def test_a_drift_that_varies_over_the_film_is_followed_slowly() -> None:
    true = np.zeros((4, 6), np.float32)
    true[:, 0], true[0, 1], true[1, 4] = FADED, 0.02, -0.02
    fitted = None
    for item in range(60):
        light = film(shaped(true), seed=item)
        fitted = film_drift(coarsen(light), coarsen(NOISE), fitted, grain=0.0, degree=2, rate=0.1)
        if item == 0:
            assert abs(fitted[0, 1]) < 0.004
    assert np.abs(shaped(fitted) - shaped(true)).max() < 2e-3


def test_a_drift_under_a_touch_is_remembered() -> None:
    true = np.zeros((4, 6), np.float32)
    true[:, 0], true[0, 3] = FADED, 0.02
    fitted = true
    for item in range(20):
        light = touched(film(shaped(true), seed=item))
        fitted = film_drift(coarsen(light), coarsen(NOISE), fitted, grain=0.0, degree=2, rate=0.1)
    assert np.abs(shaped(fitted) - shaped(true)).max() < 3e-3


PIXEL, SENSOR, COUNT = 0.1, (60, 80), 100
LIGHTS = light_ring(slant_deg=33.0, distance_mm=55.0)


@pytest.fixture(scope="module")
def scene() -> tuple[F4, F4, F4]:
    """The film at rest under each LED, the same with a touch, and the touch's height."""
    y, x = np.mgrid[: SENSOR[0], : SENSOR[1]]
    square = (x - 42) ** 2 + (y - 28) ** 2
    height = (0.6 * np.exp(-square / (2 * 8.0**2))).astype(np.float32)
    height[square > 32**2] = 0
    rest = render(np.zeros(SENSOR, np.float32), PIXEL, LIGHTS).light
    return rest, render(height, PIXEL, LIGHTS, samples=2).light, height


@pytest.fixture(scope="module")
def calibration(scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("cal") / "cal.npz"
    nothing = np.zeros((4, 9), np.float32)
    write_calibration(
        0.7 * scene[0], np.zeros(SENSOR, np.float32), PIXEL, np.ones((1, 4), np.float32),
        np.zeros((1, 2), np.float32), np.full(1, 15, np.uint8), nothing, nothing[:, 0],
        nothing[:, 0], 0.004, Film.matt(LIGHTS), np.array([0, SIGMA**2 / 4], np.float32), 1.0,
        np.zeros(8, np.float32), {}, [], np.ones(SENSOR, np.uint8), np.array(NO_MISFIT, np.float32),
        file=file, provenance=Provenance({}, None, [], {}, {}, [], []),
    )  # fmt: skip
    return file


def stream(scene) -> Iterator[tuple[bool, F4]]:
    """LEDs fade by up to 5 %, each by another amount, more at one side; touched in the middle."""
    rest, pressed, _ = scene
    rng = np.random.default_rng(7)
    side = np.linspace(0.5, 1.0, SENSOR[1], dtype=np.float32)
    for item in range(COUNT):
        touch = COUNT // 3 <= item < 2 * COUNT // 3
        fade = np.array([0.05, 0.02, 0.0, 0.03])[:, None, None] * side * item / COUNT
        light = 0.7 * (pressed if touch else rest) * (1 - fade)
        yield touch, (light + rng.normal(0, SIGMA / 2, light.shape)).astype(np.float32)


def errors(graph: str, scene, calibration: Path) -> tuple[float, float]:
    """The largest root mean square error in mm of an item at rest, and of a touched one."""
    pipeline = load(graph, calibration=str(calibration), backend="numpy")
    worst = {True: 0.0, False: 0.0}
    for touch, image in stream(scene):
        height = pipeline(frames=image)["height"]
        away = height - scene[2] * touch
        worst[touch] = max(worst[touch], float(np.sqrt(np.mean(away * away))))
    return worst[False], worst[True]


@pytest.mark.filterwarnings("ignore:this touch is not checked")
def test_without_a_touch_there_is_no_height_although_leds_fade(scene, calibration: Path) -> None:
    """The film at rest stays at zero, and the touch is right, to a few microns."""
    rest, touch = errors("reconstruct_follow_drift", scene, calibration)
    assert rest < 0.004
    assert touch < 0.006


@pytest.mark.slow
def test_a_polynomial_for_each_led_suffices_where_film_is_at_rest(scene, calibration: Path) -> None:
    rest, touch = errors("reconstruct", scene, calibration)
    assert rest < 0.004
    assert touch < 0.01
    rest, touch = errors("reconstruct_no_levelling", scene, calibration)
    assert rest > 0.03, "a fade is taken for height"
    assert touch > 0.02
