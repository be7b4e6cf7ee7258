"""A lens that is not quite sharp."""

import numpy as np
import pytest

from tactograph.nodes.simulate.blur import blur


def test_a_point_becomes_a_gaussian_spot_of_the_same_light() -> None:
    light = np.zeros((2, 41, 51), np.float32)
    light[1, 20, 25] = 1
    spot = blur(light, deviation_px=1.5)
    assert not spot[0].any()
    assert spot[1].sum() == pytest.approx(1, rel=1e-5)
    y, x = np.indices(spot[1].shape)
    assert (spot[1] * (x - 25) ** 2).sum() == pytest.approx(1.5**2, rel=0.01)
    assert (spot[1] * (y - 20) ** 2).sum() == pytest.approx(1.5**2, rel=0.01)


def test_an_even_image_stays_even_to_its_border_and_a_sharp_lens_changes_nothing() -> None:
    light = np.full((1, 9, 7), 0.4, np.float32)
    np.testing.assert_allclose(blur(light, deviation_px=2.0), light, rtol=1e-6)
    light = np.random.default_rng(0).random((3, 8, 9), np.float32)
    np.testing.assert_array_equal(blur(light), light)
