"""A grid of balls is found however deep it is pressed in."""

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes.calibrate.ball.find_balls import FoundBalls, find_balls
from tactograph.nodes.simulate.light_ring import light_ring
from tactograph.nodes.simulate.render import render

PIXEL, RADIUS, PITCH = 0.1, 1.5, 3.2
SIZE = (120, 160)
CENTRES = np.array([(x, y) for x in (20.3, 52.3, 84.3, 116.3) for y in (24.7, 56.7, 88.7)])


def found_at(contact_share: float, noise: float = 0.01) -> FoundBalls:
    y, x = np.indices(SIZE)[:, None]
    away = PIXEL * np.hypot(x - CENTRES[:, :1, None], y - CENTRES[:, 1:, None]).min(axis=0)
    sunk = RADIUS * np.sqrt(1 - contact_share**2)
    z = np.sqrt(np.maximum(RADIUS**2 - away**2, sunk**2)) - sunk
    lights = light_ring(count=3, slant_deg=40.0, distance_mm=50.0)
    seen, flat = (
        render(each.astype(np.float32), PIXEL, lights).light for each in (z, np.zeros(SIZE))
    )
    light = np.float32(seen / flat + np.random.default_rng(1).normal(0, noise, seen.shape))
    circles = np.full((1, 3), np.nan, np.float32)
    return find_balls(light, flat, np.float32([RADIUS]), circles, [""], PIXEL, pitch_mm=PITCH)


@pytest.mark.parametrize("contact_share", [0.55, 0.65, 0.75, 0.9])
def test_a_grid_is_found_however_deep_it_is_pressed(contact_share: float) -> None:
    found = found_at(contact_share)
    order = np.lexsort((found.circle[:, 1], np.round(found.circle[:, 0] / 20)))
    assert np.abs(found.circle[order, :2] - CENTRES).max() < 0.3
    assert (found.circle[:, 2] * PIXEL < 1.05 * contact_share * RADIUS).all()
    assert (found.circle[:, 2] * PIXEL > 0.7 * contact_share * RADIUS).all()


def test_a_press_without_a_grid_is_named_once(recwarn: pytest.WarningsRecorder) -> None:
    with pytest.raises(InputError, match="none of 1 presses shows a grid"):
        found_at(0.0)
    assert not [str(each.message) for each in recwarn]
