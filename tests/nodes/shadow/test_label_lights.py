"""Light that a normal explains gives that normal and the LEDs that are in shadow."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.backends.parity import compare
from tactograph.graph.backends.parity_cases import Case
from tactograph.nodes import F4
from tactograph.nodes.evaluate.evaluate_shadow import evaluate_shadow
from tactograph.nodes.optics import cache_blocks
from tactograph.nodes.optics.near_light import light_vectors, unwrapped, wrapped
from tactograph.nodes.optics.normals import angle_between
from tactograph.nodes.shadow.label_lights import Labelled, label_lights
from tactograph.nodes.simulate.render import render
from tactograph.nodes.simulate.shape_ball import shape_ball
from tactograph.nodes.slope.height_slopes import height_slopes

PIXEL, NOISE = 0.07, 0.003
UNEVEN = 0.03
WRAP = 0.2
LIGHTS = np.array([[20, 18, 45], [-19, 21, 45], [-20, -18, 46], [19, -20, 45]], np.float32)
FILM = np.zeros((6, 8), np.float32)
LEVEL = np.zeros((2, 6, 8), np.float32)


def light_of(slope: F4, lights: F4 = LIGHTS, height: F4 = FILM) -> F4:
    """The light of a film with these slopes, relative to the film at rest."""
    p, q = slope
    normal = np.stack([-p, -q, np.ones_like(p)]) / np.sqrt(1 + p * p + q * q)
    vectors = light_vectors(lights, height, PIXEL)
    return np.maximum((vectors * normal).sum(axis=1), 0).astype(np.float32)


def label(
    light: F4,
    lights: F4 = LIGHTS,
    height: F4 = FILM,
    prior: F4 = LEVEL,
    uneven: float = UNEVEN,
    wrap: float = 0.0,
    **with_,
) -> Labelled:
    sigma = np.full_like(light, NOISE)
    return label_lights(light, sigma, lights, height, prior, PIXEL, uneven, wrap, **with_)


def level(p: float, q: float) -> F4:
    return np.stack([np.full_like(FILM, p), np.full_like(FILM, q)])


slopes = st.integers(-80, 80).map(lambda hundredths: hundredths / 100)


@settings(max_examples=40)
@given(p=slopes, q=slopes, height=st.integers(-1, 6))
def test_a_lit_film_gives_its_slope(p: float, q: float, height: int) -> None:
    slope, raised = level(p, q), FILM + np.float32(height)
    result = label(light_of(slope, height=raised), height=raised)
    lit = light_of(slope, height=raised).min(axis=0) > 3 * NOISE
    assert (result.used[lit] == 0b1111).all()
    assert np.abs(result.slope - slope)[:, lit].max(initial=0) < 2e-3
    assert result.misfit[lit].max(initial=0) < 0.1


@pytest.mark.parametrize("tilt", [0.0, 0.5])
def test_noise_does_not_bias_slopes(tilt: float) -> None:
    shape, noise = (240, 320), np.float32(0.03)
    film, level = np.zeros(shape, np.float32), np.zeros((2, *shape), np.float32)
    level[0] = tilt
    light = light_of(level, height=film)
    light += np.random.default_rng(0).normal(0, noise, light.shape).astype(np.float32)
    sigma = np.full_like(light, noise)
    slope = label_lights(light, sigma, LIGHTS, film, level, PIXEL, UNEVEN, 0.0, dark=0).slope
    right, down = slope[0, :, 160:], slope[1, 120:]
    assert abs(right.mean() - slope[0, :, :160].mean()) < 1e-3
    assert abs(down.mean() - slope[1, :120].mean()) < 1e-3
    assert slope[0].mean() == pytest.approx(tilt, abs=5e-4)


@settings(max_examples=40)
@given(p=slopes, q=slopes, brighter=st.integers(-6, 6))
def test_film_of_another_brightness_has_the_same_slope(p: float, q: float, brighter: int) -> None:
    light = light_of(level(p, q)) * np.float32(1 + brighter / 100)
    result = label(light)
    lit = light.min(axis=0) > 3 * NOISE
    assert (result.used[lit] == 0b1111).all()
    assert np.abs(result.slope - level(p, q))[:, lit].max(initial=0) < 2e-3 * (1 + abs(brighter))


def test_the_brightness_of_even_film_determines_its_slope_too() -> None:
    tilted = level(0.6, 0.2)
    bright = light_of(tilted) * np.float32(1.05)
    assert np.abs(label(bright, uneven=0.0).slope - tilted).max() > 0.02
    sure, unsure = (label(light_of(tilted), uneven=u).variance[0].mean() for u in (0.0, 0.03))
    assert sure < unsure < 2 * sure


@settings(max_examples=40)
@given(p=slopes, q=slopes, led=st.integers(0, 3))
def test_a_cast_shadow_is_labelled_and_left_out(p: float, q: float, led: int) -> None:
    slope = level(p, q)
    light = light_of(slope)
    certain = light.min() > 0.1
    light[led] = 0
    result = label(light)
    if certain:
        assert (result.shadow == 1 << led).all()
        assert (result.used == 0b1111 & ~(1 << led)).all()
        assert np.abs(result.slope - slope).max() < 2e-3


def test_a_shadow_well_above_the_noise_is_labelled_by_its_misfit() -> None:
    light = light_of(level(0.3, -0.2))
    light[2] *= 0.3
    assert (label(light).shadow == 0b0100).all()


def test_shadows_are_labelled_although_none_is_quite_black() -> None:
    ball = shape_ball(radius_mm=2.0, width_px=80, height_px=80, pixel_size_mm=PIXEL).height
    rendered = render(ball, PIXEL, LIGHTS)
    rest = render(np.zeros_like(ball), PIXEL, LIGHTS).light
    light = 0.985 * rendered.light / rest + np.float32(0.015)
    slope = height_slopes(ball, PIXEL).slope
    result = label(light, height=ball, prior=slope, pair="prior").shadow
    assert evaluate_shadow(result, rendered.labels)["shadow_iou"] > 0.89


def test_with_two_shadows_the_exact_slope_is_one_of_two() -> None:
    slope = level(0.5, 0.4)
    light = light_of(slope)
    light[[0, 1]] = 0
    result = label(light, prior=level(0.45, 0.45), pair="prior")
    assert (result.used == 0b1100).all()
    assert np.abs(result.slope - slope).max() < 2e-3
    other = label(light, prior=result.twin, pair="prior")
    assert np.allclose(other.slope, result.twin, atol=1e-4)
    assert np.allclose(light_of(other.slope)[2:], light[2:], atol=1e-4)


def test_an_attached_shadow_decides_between_the_two_normals() -> None:
    steep = level(1.3, 1.3)
    light = light_of(steep)
    dark = (light == 0).all(axis=(1, 2))
    assert dark.sum() == 1, "the scene is meant to have one LED behind the surface"
    result = label(light)
    assert (result.shadow == 1 << int(np.argmax(dark))).all()
    assert np.abs(result.slope - steep).max() < 5e-3


def test_level_film_in_two_shadows_stays_level() -> None:
    light = light_of(LEVEL)
    light[[1, 2]] = 0
    for pair in ("prior", "attached"):
        assert np.abs(label(light, prior=level(1, 1), pair=pair).slope).max() < 1e-3


def test_with_one_led_the_slope_is_unknown() -> None:
    light = light_of(level(0.3, 0.1))
    light[:3] = 0
    result = label(light)
    assert not result.slope.any()
    assert not result.used.any()
    assert (result.shadow == 0b0111).all()
    assert (result.variance == 1e12).all()


def test_a_highlight_is_left_out_but_is_no_shadow() -> None:
    slope = level(0.2, 0.3)
    light = light_of(slope)
    light[3] += 0.5
    result = label(light, one_sided=-1000.0)
    assert (result.used == 0b0111).all()
    assert not result.shadow.any()
    assert np.abs(result.slope - slope).max() < 2e-3


def test_three_leds_reveal_a_shadow_by_the_length_of_the_normal() -> None:
    slope = level(0.3, 0.2)
    light = light_of(slope, LIGHTS[:3])
    light[1] = 0
    result = label(light, LIGHTS[:3], prior=slope, pair="prior")
    assert (result.shadow == 0b010).all()
    assert np.abs(result.slope - slope).max() < 2e-3


@pytest.mark.parametrize(("leds", "dimmed"), [(4, 0.3), (4, 0.6), (3, 0.6)])
def test_dirt_dims_all_leds_and_changes_no_slope(leds: int, dimmed: float) -> None:
    slope = level(0.3, -0.2)
    light = np.float32(dimmed) * light_of(slope, LIGHTS[:leds])
    result = label(light, LIGHTS[:leds])
    assert (result.used == (1 << leds) - 1).all()
    assert not result.shadow.any()
    assert np.abs(result.slope - slope).max() < 5e-3


def test_dirt_has_a_large_misfit() -> None:
    light = light_of(level(0.3, -0.2))
    assert label(light).misfit.max() < 0.1
    assert label(np.float32(0.6) * light).misfit.min() > 100


def test_film_brighter_than_a_normal_explains_is_not_taken_for_dirt() -> None:
    light = np.float32(1.6) * light_of(level(0.3, -0.2))
    alike = label(light, dimmed=1e9)
    assert (label(light).used == alike.used).all()


def in_gel(slope: F4) -> tuple[F4, F4]:
    """Matt light, and its standard deviation, of film in a gel that scatters light."""
    p, q = slope
    normal = np.stack([-p, -q, np.ones_like(p)]) / np.sqrt(1 + p * p + q * q)
    light = wrapped((light_vectors(LIGHTS, FILM, PIXEL) * normal).sum(axis=1), WRAP)
    return unwrapped(light, np.full_like(light, NOISE), WRAP)


@pytest.mark.parametrize("slope", [level(1.3, 1.3), level(-1.4, 0.9), level(1.2, -1.5)])
def test_leds_behind_a_soft_terminator_determine_the_slope(slope: F4) -> None:
    light, sigma = in_gel(slope)
    behind = (light < 0).any(axis=(1, 2))
    assert behind.any()
    result = label_lights(light, sigma, LIGHTS, FILM, LEVEL, PIXEL, UNEVEN, WRAP)
    assert np.abs(result.slope - slope).max() < 0.02
    assert not (result.shadow & ~np.uint8(behind @ (1 << np.arange(4)))).any()


@pytest.mark.parametrize("led", range(4))
def test_a_cast_shadow_under_a_soft_terminator_is_labelled(led: int) -> None:
    light, sigma = in_gel(level(0.2, -0.1))
    dark = np.full_like(light[0], -WRAP)
    light[led], sigma[led] = unwrapped(dark, np.full_like(dark, NOISE), WRAP)
    result = label_lights(light, sigma, LIGHTS, FILM, LEVEL, PIXEL, UNEVEN, WRAP)
    assert (result.shadow == 1 << led).all()
    assert (result.used == 0b1111 & ~(1 << led)).all()
    assert np.abs(result.slope - level(0.2, -0.1)).max() < 5e-3


def test_without_labels_every_led_is_used() -> None:
    light = light_of(level(0.3, 0.2))
    light[1] = 0
    result = label(light, dark=0)
    assert (result.used == 0b1111).all()
    assert not result.shadow.any()


def test_with_a_cost_labels_that_turn_a_normal_little_are_not_set() -> None:
    light = light_of(level(0.3, 0.2))
    light[1] *= 0.7
    assert (label(light).used == 0b1101).all()
    result = label(light, turn=0.8)
    assert (result.used == 0b1111).all()
    assert np.array_equal(result.slope, label(light, dark=0).slope)


def test_an_absurd_light_is_labelled_despite_the_cost() -> None:
    cracked = light_of(LEVEL) * np.float32([0.02, 0.02, 0.3, 0.3])[:, None, None]
    result, by_all = label(cracked, turn=0.8), label(cracked, dark=0)
    assert (result.used == 0b1100).all()
    assert (angle_between(result.slope, by_all.slope) > 0.8).all()


def test_the_variance_is_that_of_the_slope() -> None:
    rng = np.random.default_rng(1)
    film = np.zeros((100, 100), np.float32)
    slope = np.stack([film + np.float32(0.6), film - np.float32(0.3)])
    light = light_of(slope, height=film)
    noisy = light + rng.normal(0, NOISE, light.shape).astype(np.float32)
    result = label(noisy, height=film, prior=np.zeros_like(slope))
    lit = result.used == 0b1111
    expected = result.variance[:, lit].mean(axis=1)
    assert (result.slope - slope)[:, lit].var(axis=1) == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("count", [3, 5, 8])
def test_both_back_ends_agree_for_any_number_of_leds(device: OpenCL, count: int) -> None:
    default = {name: p.default for name, p in label_lights.parameters.items()}
    # A soft gel under an LED below the floor is not dimmed.
    for setting in (default, default | {"floor": 20.0, "dimmed": 1.0}):
        case = Case({"K": count, "H": 31, "W": 37}, "random", "default", setting)
        assert compare(label_lights, case, device) is None


def test_the_size_of_a_block_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    light = np.random.default_rng(4).uniform(0, 1.5, (4, 6, 8)).astype(np.float32)
    at_once = label(light)
    monkeypatch.setattr(cache_blocks, "BLOCK_PIXELS", 7)
    for expected, result in zip(at_once, label(light), strict=True):
        assert np.array_equal(expected, result)
