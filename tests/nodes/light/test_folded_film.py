"""Film is folded where slopes turn from cell to cell."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.light.folded_film import folded_film
from tests.nodes.scenes import ball

SHAPE = 60, 80


def walls(cells: int, steep: float = 0.8) -> F4:
    """Slopes of a groove down the frame, with walls that many cells wide."""
    slope = np.zeros((2, *SHAPE), np.float32)
    slope[0, :, 40 - 5 - cells : 40 - 5] = steep
    slope[0, :, 40 + 5 : 40 + 5 + cells] = -steep
    return slope


@pytest.mark.parametrize(("cells", "folded"), [(1, True), (2, True), (6, True), (14, False)])
def test_narrow_walls_are_folds(cells: int, folded: bool) -> None:
    """In either direction, and on as many smaller cells of a larger image."""
    slope = walls(cells)
    assert any(folded_film(slope)) == folded
    assert not folded_film(slope, narrow_ratio=0.15).wide
    assert any(folded_film(slope[::-1].transpose(0, 2, 1))) == folded
    assert any(folded_film(slope.repeat(2, axis=1).repeat(2, axis=2))) == folded


def test_a_ball_film_at_rest_and_a_grain_of_dust_have_no_folds() -> None:
    _, slope = ball(*SHAPE, 60)
    noise = np.random.default_rng(0).normal(0, 0.02, slope.shape).astype(np.float32)
    dust = noise.copy()
    dust[0, 30, 40:42] = 1, -1
    assert not any(any(folded_film(each)) for each in (slope, slope + noise, noise, dust))
