"""The evidence of near LEDs' light about a normal."""

import numpy as np
import pytest

from tactograph.nodes.optics.near_light import vectors_at
from tactograph.nodes.optics.normals import light_products, linear_normal, tangent_products

LIGHTS = np.array([[20, 18, 45], [-19, 21, 45], [-20, -18, 46], [19, -20, 45]], np.float32)
HERE = np.zeros(1, np.float32)
V = vectors_at(LIGHTS, HERE, HERE, HERE).swapaxes(0, 1)
N = np.array([[0.3], [-0.2], [np.sqrt(1 - 0.13)]], np.float32)
SIGMA = np.array([[0.01], [0.02], [0.015], [0.01]], np.float32)


def test_light_without_noise_gives_its_normal() -> None:
    light = np.einsum("ikn,in->kn", V, N)
    assert linear_normal(V, light, SIGMA**-2) == pytest.approx(N, abs=1e-5)


@pytest.mark.parametrize("uneven", [0.0, 0.03])
def test_weights_are_the_inverse_of_the_lights_covariance(uneven: float) -> None:
    """Noise of each LED, and a brightness of the film that all LEDs share."""
    (x, y, z), v = N[:, 0], V[..., 0]
    shown = v.T @ N[:, 0]
    light = shown + np.array([0.02, -0.01, 0.03, 0.0], np.float32)
    columns = np.array([v.T @ [z, 0, -x], v.T @ [0, z, -y], shown, light - shown])
    covariance = np.diag(SIGMA[:, 0] ** 2) + uneven**2 * np.outer(shown, shown)
    expected = columns @ np.linalg.inv(covariance) @ columns.T
    scale = 1e-3 * np.abs(expected).max()
    for products, rows in ((tangent_products, expected[:2]), (light_products, expected[2:, 2:])):
        product = products(V, light[:, None], SIGMA**-2, N, uneven)[..., 0]
        assert product == pytest.approx(rows, rel=1e-3, abs=scale), products
