"""Presses into a film with markers look as presses into one without."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.rings.mechanics.nodes.marker.fill_presses import fill_presses
from tactograph.rings.mechanics.nodes.marker.print_markers import print_markers
from tests.nodes.gels import Gel, ball

PIXEL_MM = 0.21
GEL = Gel(seed=3)
PRINT = {"pitch_mm": 2.5, "radius_mm": 0.35}


@pytest.fixture(scope="module")
def bare() -> F4:
    """Two presses into a film without markers."""
    return np.stack([GEL.seen(ball(x, 1.0, 4.0, 0.8)) for x in (-3.0, 3.0)])


def printed(press: F4, drag_mm: float) -> F4:
    return print_markers(press, PIXEL_MM, **PRINT, drag_x_mm=drag_mm)


def test_every_press_is_filled_at_its_own_markers(bare: F4) -> None:
    # The second press drags its markers elsewhere.
    seen = np.stack([printed(bare[0], 0.0), printed(bare[1], 1.0)])
    filled = fill_presses(seen, width_px=7, grow_px=2)
    covered = seen < 0.8 * bare
    assert (covered.mean(axis=(1, 2, 3)) > 0.03).all()
    before = np.abs(seen - bare)[covered].mean()
    after = np.abs(filled - bare)[covered].mean()
    assert after < 0.1 * before


def test_film_far_from_markers_is_unchanged(bare: F4) -> None:
    seen = np.stack([printed(press, 0.0) for press in bare])
    filled = fill_presses(seen, width_px=7)
    changed = (filled != seen).any(axis=1)
    assert changed.mean() < 0.4
    assert (seen == bare).any(axis=1)[~changed].mean() > 0.9
    even = np.full((2, 3, 30, 40), 0.5, np.float32)
    np.testing.assert_array_equal(fill_presses(even), even)
