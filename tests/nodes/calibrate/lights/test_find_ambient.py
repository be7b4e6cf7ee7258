"""Light that no LED gives is found on the calibration ball, and doubted."""

from pathlib import Path

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.calibrate.ball.press_slopes import press_slopes
from tactograph.nodes.calibrate.lights.find_ambient import WithoutAmbient, find_ambient
from tactograph.nodes.simulate.light_ring import light_ring
from tactograph.nodes.simulate.render import render

from .test_calibrate_lights import BLANK, FILM, PIXEL, RING, SIZE, calibrate, known, off, seen

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


@pytest.mark.one_case
@pytest.mark.parametrize("ambient", [0.0, 0.05])
def test_leds_that_face_the_film_are_no_ambient_light(ambient: float) -> None:
    """Over a grid of balls the sides of the film, which get less light, look like ambient light."""
    lights = light_ring(slant_deg=40.0, distance_mm=30.0)
    circle = np.float32([(x, y, 12) for x in (25, 60, 100, 135) for y in (25, 60, 95)])
    radius, of = np.full(len(circle), 2.0, np.float32), np.zeros(len(circle), np.int32)
    shape = press_slopes(BLANK + 1, BLANK + 1, circle, radius, of, PIXEL)
    y, x = np.indices(SIZE)[:, None]
    away = PIXEL * np.hypot(x - circle[:, 0, None, None], y - circle[:, 1, None, None]).min(axis=0)
    z = np.sqrt(np.maximum(4 - away**2, 1.6**2)) - 1.6
    rng = np.random.default_rng(0)
    ball, flat = (
        (render(each, PIXEL, lights, cosine_leds=True).light + ambient).astype(np.float32)
        + rng.normal(0, 0.002, BLANK.shape).astype(np.float32)
        for each in (z.astype(np.float32), FILM)
    )
    found = find_ambient(ball, flat, BLACK, shape.slope, shape.mask, shape.height, PIXEL)
    assert found.quality.get("ambient_percent", 0) == pytest.approx(100 * ambient, abs=0.6)
