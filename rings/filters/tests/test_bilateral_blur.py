"""A bilateral filter takes out noise but no steps."""

import numpy as np

from tactograph.rings.filters.nodes.bilateral_blur import bilateral_blur
from tactograph.rings.filters.nodes.gaussian_blur import gaussian_blur


def test_noise_goes_and_a_step_stays() -> None:
    step = np.zeros((1, 60, 60), np.float32)
    step[:, :, 30:] = 1
    noise = 0.02 * np.random.default_rng(1).standard_normal(step.shape).astype(np.float32)
    found = bilateral_blur(step + noise, radius=3, sigma_light=0.1, sigma_px=1.5)
    assert (found - step).std() < 0.4 * noise.std()
    assert np.abs(found - step)[:, :, 28:32].max() < 0.05
    assert np.abs(gaussian_blur(step, sigma=1.5) - step)[:, :, 28:32].max() > 0.3
