"""Light that no LED gives is found on the calibration ball, and doubted."""

from pathlib import Path

import numpy as np
import pytest

from tactograph.nodes import F4, Film
from tactograph.nodes.calibrate.ball.press_slopes import press_slopes
from tactograph.nodes.calibrate.lights.find_ambient import WithoutAmbient, find_ambient
from tactograph.nodes.light.film_bounce import film_bounce
from tactograph.nodes.simulate.light_ring import light_ring
from tactograph.nodes.simulate.render import render

from .test_calibrate_lights import BLANK, FILM, PIXEL, RING, SIZE, calibrate, images, known, off

BLACK = np.zeros(BLANK.shape[1:], np.float32)


def without_ambient(ambient: float, taken: Path | None = None) -> tuple[WithoutAmbient, F4]:
    ball, flat = (plane + np.float32(ambient) for plane in images(RING))
    return find_ambient(ball, flat, BLACK, *known(), PIXEL, taken=taken), ball


@pytest.mark.one_case
@pytest.mark.parametrize("ambient", [0.03, 0.12])
def test_ambient_light_is_found_doubted_and_subtracted(ambient: float) -> None:
    result, ball = without_ambient(ambient)
    assert np.abs(result.dark - ambient).max() < 0.006
    assert result.quality["ambient_percent"] == pytest.approx(100 * ambient, abs=0.6)
    assert "`taken`=FILE" in result.doubts[0]
    placed = calibrate(ball - result.dark, result.flat, known())
    assert off(placed.film.lights, RING) < 0.02
    flat = images(RING)[1] + np.float32(ambient)
    assert off(calibrate(ball, flat, known()).film.lights, RING) > 0.03


def test_without_ambient_light_nothing_changes() -> None:
    result, _ = without_ambient(0.0)
    assert not result.dark.any()
    assert np.array_equal(result.flat, images(RING)[1])
    assert not result.doubts
    assert not result.quality


def test_a_dark_image_that_was_taken_is_kept() -> None:
    result, _ = without_ambient(0.1, taken=Path("dark.png"))
    assert not result.dark.any()
    assert not result.doubts


def test_a_black_shadow_shows_that_there_is_no_ambient_light() -> None:
    ball, flat = images(RING)
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


@pytest.mark.one_case
@pytest.mark.parametrize("ambient", [0.0, 0.1])
def test_light_from_film_to_film_is_no_ambient_light(ambient: float) -> None:
    """Both fill shadows of the object alike, but film beside it is brightened by film alone."""
    direct, flat = images(RING)
    film, ball = Film.matt(RING)._replace(albedo=0.6), direct
    for _ in range(6):
        ball = direct + flat * film_bounce(ball / flat, known().height, film, PIXEL)
    both = (plane + np.float32(ambient) for plane in (ball, flat))
    found = find_ambient(*both, BLACK, *known(), PIXEL)
    assert found.quality.get("ambient_percent", 0) == pytest.approx(100 * ambient, abs=1)
