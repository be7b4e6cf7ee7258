"""Light that no LED gives is found on the calibration ball, and doubted."""

from pathlib import Path

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.calibrate.lights.find_ambient import WithoutAmbient, find_ambient
from tactograph.nodes.simulate.light_ring import light_ring

from .test_calibrate_lights import BLANK, PIXEL, calibrate, known, off, seen

LIGHTS = light_ring(slant_deg=33.0, distance_mm=55.0)
BLACK = np.zeros(BLANK.shape[1:], np.float32)


def found_with(ambient: float, taken: Path | None = None) -> tuple[WithoutAmbient, F4, list[str]]:
    ball, flat = (plane + np.float32(ambient) for plane in seen(LIGHTS))
    shape = known()
    known_there = shape.slope, shape.mask, shape.height
    found = find_ambient(ball, flat, BLACK, *known_there, PIXEL, taken=taken)
    return found, ball, found.doubts


@pytest.mark.one_case
@pytest.mark.parametrize("ambient", [0.03, 0.12])
def test_ambient_light_is_found_doubted_and_taken_off(ambient: float) -> None:
    found, ball, notes = found_with(ambient)
    assert np.abs(found.dark - ambient).max() < 0.006
    assert found.quality["ambient_percent"] == pytest.approx(100 * ambient, abs=0.6)
    assert "dark=FILE" in notes[0]
    placed = calibrate(ball - found.dark, found.flat, known())
    assert off(placed.lights, LIGHTS) < 0.02
    flat = seen(LIGHTS)[1] + np.float32(ambient)
    assert off(calibrate(ball, flat, known()).lights, LIGHTS) > 0.03


def test_where_there_is_none_nothing_changes() -> None:
    found, _, notes = found_with(0.0)
    assert not found.dark.any()
    assert np.array_equal(found.flat, seen(LIGHTS)[1])
    assert not notes
    assert not found.quality


def test_where_a_dark_image_was_taken_it_stays() -> None:
    found, _, notes = found_with(0.1, taken=Path("dark.png"))
    assert not found.dark.any()
    assert not notes


def test_a_black_shadow_shows_that_there_is_no_ambient_light() -> None:
    ball, flat = seen(LIGHTS)
    shape = known()
    hollow = ball + np.float32(0.05) * shape.mask
    hollow[0, :20, :20] = 0
    found = find_ambient(hollow, flat, BLACK, shape.slope, shape.mask, shape.height, PIXEL)
    assert not found.dark.any()
