"""The noise of light, and that of the film at rest."""

import numpy as np
import pytest

from tactograph.nodes.light.light_noise import light_noise, rest_noise

NOISE = np.array([1e-4, 4e-6], np.float32)
LEVELS = np.array([0.2, 0.6, 0.99], np.float32)[:, None, None]
FULL = np.ones((3, 1, 1), np.float32)


def test_film_at_rest_has_the_noise_of_any_light() -> None:
    assert (rest_noise(LEVELS, NOISE) == light_noise(LEVELS, LEVELS, NOISE)).all()
    dark = LEVELS / 100
    assert (rest_noise(dark, NOISE, 1e-3) == light_noise(dark, dark, NOISE, floor=1e-3)).all()


def test_only_a_captured_light_is_saturated() -> None:
    """A flat frame that was not taken is 1, which is no measurement."""
    assert light_noise(FULL, FULL, NOISE) == pytest.approx(1, abs=1e-3)
    assert rest_noise(FULL, NOISE) == pytest.approx(np.sqrt(NOISE.sum()))
