"""Light ends at the terminator: sharply under a point, softly in a gel that scatters."""

import numpy as np
import pytest

from tactograph.nodes.optics.near_light import unwrapped, wrapped

DIRECT = np.linspace(-1, 1.2, 221, dtype=np.float32)


@pytest.mark.parametrize("wrap", [0.05, 0.2, 0.4])
def test_light_falls_smoothly_to_a_shadow_at_a_soft_terminator(wrap: float) -> None:
    light = wrapped(DIRECT, wrap)
    assert np.array_equal(light[DIRECT >= 0], DIRECT[DIRECT >= 0])
    assert light.min() == pytest.approx(-wrap)
    steps = np.diff(light)
    assert (steps >= 0).all()
    assert (np.diff(steps) > -1e-6).all()


@pytest.mark.parametrize("wrap", [0.0, 0.05, 0.2, 0.4])
def test_unwrapping_inverts_wrapping(wrap: float) -> None:
    above = DIRECT[-1.3 * wrap < DIRECT]
    light = wrapped(above, wrap)
    restored, sigma = unwrapped(light, np.full_like(light, 0.01), wrap)
    assert restored == pytest.approx(above, abs=1e-5)
    assert (sigma[above >= 0] == np.float32(0.01)).all()
    # Under a point film behind the terminator is dark.
    assert np.array_equal(wrapped(DIRECT, 0.0), np.maximum(DIRECT, 0))
