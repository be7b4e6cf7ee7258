"""Light that no LED gives is found on the calibration ball, and doubted."""

from pathlib import Path

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.calibrate.lights.find_ambient import WithoutAmbient, find_ambient

from .test_calibrate_lights import BLANK, PIXEL, RING, calibrate, known, off, seen

BLACK = np.zeros(BLANK.shape[1:], np.float32)


def found_with(ambient: float, taken: Path | None = None) -> tuple[WithoutAmbient, F4]:
    ball, flat = (plane + np.float32(ambient) for plane in seen(RING))
    return find_ambient(ball, flat, BLACK, *known(), PIXEL, taken=taken), ball


@pytest.mark.one_case
@pytest.mark.parametrize("ambient", [0.03, 0.12])
def test_ambient_light_is_found_doubted_and_taken_off(ambient: float) -> None:
    found, ball = found_with(ambient)
    assert np.abs(found.dark - ambient).max() < 0.006
    assert found.quality["ambient_percent"] == pytest.approx(100 * ambient, abs=0.6)
    assert "`taken`=FILE" in found.doubts[0]
    placed = calibrate(ball - found.dark, found.flat, known())
    assert off(placed.lights, RING) < 0.02
    flat = seen(RING)[1] + np.float32(ambient)
    assert off(calibrate(ball, flat, known()).lights, RING) > 0.03


def test_where_there_is_none_nothing_changes() -> None:
    found, _ = found_with(0.0)
    assert not found.dark.any()
    assert np.array_equal(found.flat, seen(RING)[1])
    assert not found.doubts
    assert not found.quality


def test_where_a_dark_image_was_taken_it_stays() -> None:
    found, _ = found_with(0.1, taken=Path("dark.png"))
    assert not found.dark.any()
    assert not found.doubts


def test_a_black_shadow_shows_that_there_is_no_ambient_light() -> None:
    ball, flat = seen(RING)
    hollow = ball + np.float32(0.05) * known().mask
    hollow[0, :20, :20] = 0
    assert not find_ambient(hollow, flat, BLACK, *known(), PIXEL).dark.any()
