"""A median takes out what is small and leaves edges where they are."""

from typing import Literal

import numpy as np
import pytest

from tactograph.rings.filters.nodes.median_blur import median_blur


@pytest.mark.parametrize(("size", "speck", "goes"), [(3, 2, True), (5, 3, True), (3, 3, False)])
def test_a_speck_of_less_than_half_the_window_goes_and_an_edge_stays(
    size: Literal[3, 5], speck: int, goes: bool
) -> None:
    edge = np.zeros((1, 20, 20), np.float32)
    edge[:, :, 12:] = 1
    dirty = edge.copy()
    dirty[:, 5 : 5 + speck, 4 : 4 + speck] = 1
    assert np.array_equal(median_blur(dirty, size=size), edge) == goes
