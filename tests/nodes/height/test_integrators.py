"""Integrators recover the surface of the slopes, at its true scale."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tactograph.nodes.height.integrate_dct import integrate_dct
from tactograph.nodes.height.integrate_frankot_chellappa import integrate_frankot_chellappa
from tests.nodes.scenes import ball, waves

SIZES = [(240, 320), (480, 640), (121, 201), (64, 97), (1, 50), (37, 1)]


def rmse(height, truth):
    return float(np.std(height.astype(np.float64) - truth))


@pytest.mark.parametrize("size", SIZES)
def test_a_smooth_surface_that_leaves_the_frame_at_any_height_is_integrated(size) -> None:
    z, slope = waves(*size)
    assert rmse(integrate_dct(slope, 1.0), z) < 0.002 * np.ptp(z)


@pytest.mark.parametrize("size", SIZES[:4])
def test_the_scale_does_not_depend_on_the_image_size(size) -> None:
    z, slope = ball(*size, radius=max(size) * 0.9)
    height = integrate_dct(slope, 1.0)
    assert np.ptp(height) == pytest.approx(np.ptp(z), rel=1e-2)


def test_a_tilted_plane_is_integrated() -> None:
    slope = np.stack([np.full((90, 70), 0.3), np.full((90, 70), -0.2)]).astype(np.float32)
    y, x = np.mgrid[:90, :70]
    assert rmse(integrate_dct(slope, 1.0), 0.3 * x - 0.2 * y) < 0.02


@pytest.mark.parametrize("size", [(240, 320), (121, 201), (64, 97)])
def test_frankot_chellappa_integrates_a_surface_that_returns_to_its_start(size) -> None:
    y, x = np.mgrid[: size[0], : size[1]].astype(np.float64)
    u, v = 4 * np.pi / size[1], 2 * np.pi / size[0]
    z = 3 * np.sin(u * x) * np.cos(v * y)
    slope = np.stack(
        [3 * u * np.cos(u * x) * np.cos(v * y), -3 * v * np.sin(u * x) * np.sin(v * y)]
    )
    height = integrate_frankot_chellappa(slope.astype(np.float32), 1.0)
    assert rmse(height, z) < 1e-4


@given(pixel=st.floats(0.001, 1), seed=st.integers(0, 1000))
def test_height_is_linear_in_slope_and_in_the_pixel_size(pixel, seed) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.normal(0, 1, (2, 2, 20, 30)).astype(np.float32)
    together = integrate_dct(a + b, pixel)
    separately = integrate_dct(a, pixel) + integrate_dct(b, pixel)
    assert np.allclose(together, separately, atol=2e-4 * pixel)
    assert np.allclose(integrate_dct(a, pixel), integrate_dct(a, 1.0) * pixel, atol=1e-4 * pixel)
