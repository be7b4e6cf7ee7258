"""Images that a calibrated camera would take have the noise that its calibration states."""

import numpy as np
import pytest

from tactograph.nodes.simulate.expose_film import expose_film

FLAT = np.full((4, 320, 320), 0.5, np.float32)
ONES = np.ones_like(FLAT)


@pytest.mark.parametrize("correlation", [1.0, 2.5, 4.0])
def test_the_noise_has_the_stated_strength_and_correlation(correlation: float) -> None:
    noise = np.float32([1e-4, 2e-5])
    image, count = expose_film(ONES, FLAT, noise, correlation, bits=16, seed=1)
    assert count == 1
    off = image - FLAT
    bent = np.diff(np.diff(off, 2, axis=1), 2, axis=2)
    assert bent.var() / 36 == pytest.approx(7e-5, rel=0.03)
    means = off.reshape(4, 80, 4, 80, 4).mean(axis=(2, 4))
    assert 16 * means.var() == pytest.approx(7e-5 * correlation, rel=0.05)
    assert np.abs(np.corrcoef(off.reshape(4, -1)) - np.eye(4)).max() < 0.02


def test_the_noise_is_normal_and_differs_between_images() -> None:
    first, count = expose_film(ONES, FLAT, np.float32([0, 1e-4]), bits=16, seed=1)
    second, _ = expose_film(ONES, FLAT, np.float32([0, 1e-4]), before=count, bits=16, seed=1)
    off = (first - FLAT) / 0.01
    assert np.mean(off**4) == pytest.approx(3, abs=0.05)
    assert abs(np.corrcoef(off.ravel(), (second - FLAT).ravel())[0, 1]) < 0.01
