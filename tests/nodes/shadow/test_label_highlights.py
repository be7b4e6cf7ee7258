"""Highlights are found where the film mirrors an LED, and nowhere else."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.shadow.label_highlights import label_highlights
from tactograph.nodes.shadow.label_lights import label_lights
from tests.nodes.scenes import LIGHTS, ball, lambert

FAR = 1e4 * LIGHTS
SHAPE = (60, 60)
PIXEL = 0.1
SIGMA = np.float32(0.005)


def glossy(gloss: float, lights: F4 = LIGHTS) -> tuple[F4, F4, F4]:
    """A cap's light relative to the film at rest, its mirrored part, and its slope."""
    slope = ball(*SHAPE, 60)[1]
    p, q = slope
    normal = np.stack([-p, -q, np.ones_like(p)]) / np.sqrt(1 + p * p + q * q)
    half = lights + np.float32([0, 0, 1])
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    mirrored = gloss * np.tensordot(half, normal, axes=1) ** 300
    light = (lambert(slope, lights) + mirrored) / lights[:, 2, None, None]
    noise = np.random.default_rng(5).normal(0, SIGMA, light.shape)
    return np.asarray(light + noise, np.float32), np.asarray(mirrored, np.float32), slope


def highlights(light: F4, lights: F4 = FAR) -> tuple[F4, F4]:
    sigma = np.full_like(light, SIGMA)
    level = np.zeros(SHAPE, np.float32)
    highlight, raised = label_highlights(light, sigma, lights, level, PIXEL)
    return highlight, raised


def test_each_led_is_mirrored_where_the_cap_faces_half_way_to_it() -> None:
    light, mirrored, _ = glossy(0.5)
    highlight, sigma = highlights(light)
    for k in range(4):
        bit = (highlight >> k & 1).astype(bool)
        assert bit[mirrored[k] > 20 * SIGMA].mean() > 0.95
        assert not bit[mirrored[k] < SIGMA].any()
        assert (sigma[k][bit] > 1).all()
        assert (sigma[k][~bit] == SIGMA).all()


def test_a_matt_film_has_no_highlight() -> None:
    assert (highlights(glossy(0.0)[0])[0] > 0).mean() < 1e-3


def test_a_shadow_is_no_highlight() -> None:
    light, _, _ = glossy(0.0)
    light[1, 20:40, 20:40] = 0
    assert (highlights(light)[0] > 0).mean() < 1e-3


def test_the_slope_is_right_under_the_highlight() -> None:
    light, mirrored, slope = glossy(0.5)
    flat, level = np.zeros((2, *SHAPE), np.float32), np.zeros(SHAPE, np.float32)
    highlit = (mirrored > 20 * SIGMA).any(axis=0)
    labelled = label_lights(light, highlights(light)[1], FAR, level, flat, PIXEL, 0.03, 0.0)
    assert not labelled.shadow[highlit].any()
    assert np.abs(labelled.slope - slope)[:, highlit].mean() < 0.008


def test_three_leds_give_no_highlight() -> None:
    light, _, _ = glossy(0.5, LIGHTS[:3])
    highlight, sigma = highlights(light, FAR[:3])
    assert not highlight.any()
    assert sigma == pytest.approx(SIGMA)
