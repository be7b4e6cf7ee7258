"""The film at rest is made level, and what an object lifts keeps its height."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.height.level_height import level_height

CELL, GRAIN = 4, 0.01
V, U = np.mgrid[-0.75:0.75:120j, -1:1:160j].astype(np.float32)
ERROR = np.asarray(0.02 + 0.03 * U - 0.02 * V + 0.03 * U * V + 0.02 * U**3, np.float32)
"""A smooth error of the height over the frame, in mm."""


def levelled(height: F4, touched: F4, grain: float = GRAIN) -> F4:
    """Level a height with film at rest wherever no wall of a touch is."""
    cells = touched.reshape(30, CELL, 40, CELL).max(axis=(1, 3))
    light = np.ones((3, 30, 40), np.float32) + 0.3 * (cells > 0)
    return level_height(height, light.astype(np.float32), grain, cell=CELL)


def test_a_smooth_error_is_removed_around_a_touch() -> None:
    touch = np.maximum(0, 0.5 - np.hypot(U, V)).astype(np.float32)
    assert levelled(ERROR + touch, touch) == pytest.approx(touch, abs=0.002)


def test_flat_tops_keep_their_height_also_at_the_border() -> None:
    """They are as calm as film at rest, and hold a third of the frame."""
    top = ((np.abs(U - 0.4) < 0.25) & (V > -0.5)) | ((np.abs(U + 0.3) < 0.15) & (np.abs(V) < 0.4))
    inner = (np.abs(U - 0.4) < 0.2) & (V > -0.45)
    inner |= (np.abs(U + 0.3) < 0.1) & (np.abs(V) < 0.35)
    walls = (top & ~inner).astype(np.float32)
    height = ERROR + np.float32(0.2) * top
    assert levelled(height, walls)[inner] == pytest.approx(0.2, abs=0.01)
    assert levelled(height, walls)[~top] == pytest.approx(0, abs=0.01)


def test_without_a_grain_there_is_no_error_to_remove() -> None:
    assert (levelled(ERROR, np.zeros_like(U), grain=0.0) == ERROR).all()
