"""Confidence in shadow labels: high inside a shadow, lower at its edge."""

import numpy as np

from tactograph.nodes import F4, U1
from tactograph.nodes.shadow.shadow_confidence import shadow_confidence
from tactograph.nodes.simulate.light_ring import light_ring

SHAPE = (24, 32)
LIGHTS = light_ring(slant_deg=33.0, distance_mm=55.0)
LEVEL = np.zeros((2, *SHAPE), np.float32)
FILM = np.zeros(SHAPE, np.float32)


def cast() -> tuple[U1, F4]:
    """The right half of the film in the shadow of LED 1: labels, and light."""
    shadow, light = np.zeros(SHAPE, np.uint8), np.ones((4, *SHAPE), np.float32)
    shadow[:, 16:], light[0, :, 16:] = 0b1, 0
    return shadow, light


def confidence(shadow: U1, light: F4, seen: U1 | None = None, noise: float = 0.01) -> F4:
    sigma = np.full_like(light, noise)
    said = shadow if seen is None else seen
    return shadow_confidence(shadow, said, light, sigma, LEVEL, FILM, LIGHTS, 0.1)


def test_labels_far_from_edges_are_certain_and_edges_are_not() -> None:
    found = confidence(*cast())
    assert found[:, :13].min() > 0.99
    assert found[:, 19:].min() > 0.99
    assert found[:, 15:17].max() < found[:, 14].max() < found[:, 12].max()
    assert ((found > 0) & (found <= 1)).all()


def test_light_in_a_shadow_lowers_the_confidence() -> None:
    shadow, light = cast()
    clear = confidence(shadow, light)
    light[0, :, 24] = 1
    doubted = confidence(shadow, light)
    assert (doubted[:, 24] < 0.995).all()
    assert (1 - doubted[:, 24] > 3 * (1 - clear[:, 24])).all()
    assert np.array_equal(np.delete(doubted, 24, axis=1), np.delete(clear, 24, axis=1))


def test_noisy_light_counts_little() -> None:
    shadow, light = cast()
    light[0, :, 24] = 1
    assert (confidence(shadow, light, noise=1.0) > confidence(shadow, light))[:, 24].all()


def test_an_image_that_disagrees_lowers_the_confidence() -> None:
    shadow, light = cast()
    seen = shadow.copy()
    seen[:, 20] = 0
    contradicted = confidence(shadow, light, seen)
    assert (contradicted[:, 20] < confidence(shadow, light)[:, 20]).all()


def test_confidence_is_that_of_the_labels_of_all_leds() -> None:
    shadow, light = cast()
    one = confidence(shadow, light)[:, 16]
    shadow[:, 16:] |= 0b10
    light[1, :, 16:] = 0
    assert np.allclose(confidence(shadow, light)[:, 16], one * one, atol=0.01)
