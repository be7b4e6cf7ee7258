"""What lies under a marker is filled from around it."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.rings.mechanics.nodes.marker.fill_masked import fill_masked

Y, X = np.indices((30, 40)).astype(np.float32)


def test_light_that_changes_evenly_continues_across_a_hole() -> None:
    light: F4 = (0.3 + 0.01 * X - 0.005 * Y)[None].astype(np.float32)
    mask = np.ones((30, 40), np.uint8)
    mask[10:15, 20:25] = 0
    spoilt = np.where(mask > 0, light, np.float32(0))
    np.testing.assert_allclose(fill_masked(spoilt, mask), light, atol=2e-3)


@pytest.mark.parametrize(("near", "far"), [(0.1, 0.9), (0.9, 0.1)])
def test_beyond_a_step_at_the_border_there_is_neither_less_than_no_light_nor_a_glare(
    near: float, far: float
) -> None:
    """A plane through both sides of a step would go on for as much again."""
    light: F4 = np.where(X < 14, near, far)[None].astype(np.float32)
    mask = (X >= 10).astype(np.uint8)
    filled = fill_masked(light, mask)
    assert filled.min() >= 0
    assert filled.max() <= 2 * 0.9
