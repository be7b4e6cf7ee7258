"""Where blur mixes two sides of an edge, slopes have a larger variance."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.slope.edge_variance import edge_variance

EDGE = 10
"""The first column of the steep side."""


def deviation(steep: float, blur: float = 1.0) -> F4:
    """The increased standard deviation of a slope at a rim, along a row."""
    slope = np.zeros((2, 12, 20), np.float32)
    slope[0, :, EDGE:] = steep
    none = np.zeros_like(slope)
    return np.asarray(np.sqrt(edge_variance(none, slope, blur))[0, 6])


def test_only_pixels_at_an_edge_have_a_larger_variance() -> None:
    found = deviation(2.0)
    assert (found[EDGE - 2 : EDGE + 2] > 0.1).all()
    assert not found[: EDGE - 2].any()
    assert not found[EDGE + 2 :].any()
    assert deviation(4.0)[EDGE] > 4


@pytest.mark.parametrize("steep", [0.02, 0.05])
def test_gentle_film_keeps_its_variance(steep: float) -> None:
    assert deviation(steep).max() < 0.002


def test_the_deviation_grows_with_the_square_of_the_blur() -> None:
    np.testing.assert_allclose(deviation(2.0, 0.8), 0.64 * deviation(2.0), rtol=1e-5)
    assert not deviation(2.0, 0.0).any()
