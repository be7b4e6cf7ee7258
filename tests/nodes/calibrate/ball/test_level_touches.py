"""A film model is fitted to presses around which the film at rest has the flat frame's light."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.calibrate.ball.level_touches import level_touches

SIZE = 96, 128
NOISE = np.array([2e-5, 1e-6], np.float32)
FLAT = np.full((4, *SIZE), 0.5, np.float32)
V, U = (np.mgrid[: SIZE[0], : SIZE[1]] - np.array([47.5, 63.5])[:, None, None]) / 64
ON = np.hypot(U, V) < 0.35
PRESS = np.where(ON, 1 + U * np.array([1, -1, 0.5, -0.5])[:, None, None], 1)


FACTORS = np.random.default_rng(1).uniform(0.95, 1.05, (2, 4, 1, 1))
"""Between each LED's light and the flat frame's, by press."""


@pytest.mark.parametrize("flat", [FLAT, np.ones_like(FLAT)], ids=["taken", "full_scale"])
def test_each_press_is_levelled_by_the_film_around_it(flat: F4) -> None:
    rng = np.random.default_rng(0)
    drifted = [PRESS * factor + rng.normal(0, 0.005, PRESS.shape) for factor in FACTORS]
    sheet = np.concatenate(drifted, axis=1).astype(np.float32)
    levelled = level_touches(sheet, flat, NOISE)
    for i in range(2):
        difference = levelled[:, i * SIZE[0] : (i + 1) * SIZE[0]] - PRESS
        assert np.abs(difference.mean(axis=(1, 2))).max() < 1e-3
        assert difference.std() < 0.006


def test_film_that_a_thick_gel_lifts_around_the_ball_keeps_its_slopes() -> None:
    away = np.maximum(np.hypot(U, V), 0.35)
    steep = 0.01 * (0.35 / away) ** 2
    towards = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])[:, :, None, None]
    lifted = PRESS + steep * (towards[:, 0] * U + towards[:, 1] * V) / away
    sheet = lifted.astype(np.float32)
    assert level_touches(sheet, FLAT, NOISE) == pytest.approx(sheet, abs=1e-4)


@pytest.mark.parametrize("what", ["level", "tilted"])
def test_the_touch_itself_does_not_change_the_level(what: str) -> None:
    light = np.where(ON, 1.3, 1) if what == "level" else PRESS
    sheet = np.broadcast_to(light, (4, *SIZE)).astype(np.float32)
    assert level_touches(sheet, FLAT, NOISE) == pytest.approx(sheet, abs=1e-4)
