"""Images with another number of pixels."""

import cv2
import numpy as np
import pytest

from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.backends.parity import compare
from tactograph.graph.backends.parity_cases import Case
from tactograph.rings.filters.nodes.resize_image import Method, resize_image

LIGHT = np.random.default_rng(1).random((2, 24, 32), np.float32)


def test_half_the_size_is_the_mean_of_four_pixels() -> None:
    found = resize_image(LIGHT)
    mean = LIGHT.reshape(2, 12, 2, 16, 2).mean(axis=(2, 4))
    np.testing.assert_allclose(found, mean, rtol=1e-6)


@pytest.mark.parametrize("scale", [0.1, 0.3, 0.7, 1.0, 1.6, 5.0])
def test_what_is_even_stays_even_and_the_mean_stays_the_mean(scale: float) -> None:
    even = np.full((1, 40, 60), 0.7, np.float32)
    np.testing.assert_allclose(resize_image(even, scale=scale), 0.7, rtol=1e-5)
    found = resize_image(LIGHT, scale=scale)
    assert found.shape == (2, round(24 * scale), round(32 * scale))
    assert found.mean() == pytest.approx(LIGHT.mean(), abs=2e-3)


def test_a_slope_stays_where_it_is() -> None:
    across = np.tile(np.arange(32, dtype=np.float32), (1, 24, 1))
    for method in ("area", "linear"):
        found = resize_image(across, scale=0.25, method=method)
        np.testing.assert_allclose(found[0, 0], 4 * np.arange(8) + 1.5, atol=1e-4)
    twice = resize_image(across, scale=2.0, method="linear")
    np.testing.assert_allclose(twice[0, 0, 1:-1], np.arange(1, 63) / 2 - 0.25, atol=1e-4)


def test_one_pixel_is_left_of_the_smallest_image() -> None:
    found = resize_image(LIGHT[:, :3, :4], scale=0.05)
    np.testing.assert_allclose(found[:, 0, 0], LIGHT[:, :3, :4].mean(axis=(1, 2)), rtol=1e-5)


@pytest.mark.parametrize("method", ["area", "linear"])
@pytest.mark.parametrize("scale", [0.05, 0.11, 1 / 3, 0.5, 0.83, 1.0, 1.01, 1.37, 2.0, 3.3])
@pytest.mark.parametrize("shape", [(48, 64), (31, 37), (5, 200), (1, 7)])
def test_both_back_ends_are_opencvs_function(
    device: OpenCL, scale: float, method: Method, shape: tuple[int, int]
) -> None:
    rows, columns = shape
    size = max(1, round(columns * scale)), max(1, round(rows * scale))
    light = np.random.default_rng(2).random((1, *shape), np.float32)
    rule = cv2.INTER_AREA if method == "area" else cv2.INTER_LINEAR
    expected = cv2.resize(light[0], size, interpolation=rule)
    np.testing.assert_array_equal(resize_image(light, scale=scale, method=method)[0], expected)
    sizes = {"K": 3, "H": rows, "W": columns, "h": size[1], "w": size[0]}
    case = Case(sizes, "random", "any", {"scale": scale, "method": method})
    assert compare(resize_image, device, case) is None
