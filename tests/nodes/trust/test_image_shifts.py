"""Images that show the film at different places are found, and how far they lie apart."""

import cv2
import numpy as np
import pytest

from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4
from tactograph.nodes.optics.near_light import matt_film_light
from tactograph.nodes.simulate.light_ring import light_ring
from tactograph.nodes.slope.height_slopes import height_slopes
from tactograph.nodes.trust.image_shifts import creep_and_shift, image_shifts
from tactograph.nodes.trust.judge_touch import judge_touch
from tactograph.nodes.trust.touch_evidence import touch_evidence
from tests.nodes.trust.law import ranks

ROWS, COLUMNS, PIXEL = 60, 80, 0.25
Y, X = np.mgrid[:ROWS, :COLUMNS].astype(np.float32)
HEIGHT = np.float32(1.2) * np.exp(-((X - 45) ** 2 + (Y - 28) ** 2) / 80)
STILL = np.zeros((4, 2))
CREEP = np.outer(np.arange(4), [0.3, -0.2])
ONE_OFF = np.outer([0, 0, 1, 0], [0.0, 0.6])


def seen(lights: F4, shifts: F4, noise: float = 0.0005) -> F4:
    """The light of a bump, each LED's image shifted by cells along x and y."""
    light = matt_film_light(lights, HEIGHT, height_slopes(HEIGHT, PIXEL).slope, PIXEL)
    moved = [
        cv2.warpAffine(plane, np.float32([[1, 0, x], [0, 1, y]]), (COLUMNS, ROWS), borderValue=1)
        for plane, (x, y) in zip(light, shifts, strict=True)
    ]
    rng = np.random.default_rng(3)
    return np.float32(moved + rng.normal(0, noise, light.shape))


def found(lights: F4, light: F4, height: F4 = HEIGHT) -> F4:
    used = np.full((ROWS, COLUMNS), (1 << len(lights)) - 1, np.uint8)
    return image_shifts(light, used, height, lights, PIXEL)


@pytest.mark.parametrize("distance_mm", [40.0, 400.0])
@pytest.mark.parametrize("shifts", [CREEP, ONE_OFF])
def test_film_that_moves_between_flashes_is_found(distance_mm: float, shifts: F4) -> None:
    """A pixel from flash to flash costs 30 to 60 um, and no check told it."""
    lights = light_ring(distance_mm=distance_mm)
    measured = -found(lights, seen(lights, shifts)) * COLUMNS
    assert measured == pytest.approx(shifts - shifts.mean(axis=0), abs=0.15)


def test_light_that_a_surface_explains_shows_no_shift() -> None:
    lights = light_ring(distance_mm=40.0)
    assert not found(lights, seen(lights, STILL)).any()
    together = np.broadcast_to([0.5, 0.3], (4, 2))
    assert not found(lights, seen(lights, together)).any()
    untouched = np.random.default_rng(1).normal(1, 0.01, (4, ROWS, COLUMNS)).astype(np.float32)
    assert not found(lights, untouched, 0 * HEIGHT).any()


def test_three_lights_and_film_in_shadow_tell_nothing() -> None:
    lights = light_ring(count=3, distance_mm=40.0)
    assert not found(lights, seen(lights, CREEP[:3])).any()
    lights = light_ring(distance_mm=40.0)
    light = seen(lights, CREEP)
    assert not image_shifts(light, np.full((ROWS, COLUMNS), 7, np.uint8), HEIGHT, lights, 1).any()


def test_a_shift_is_told_in_words_where_no_valid_touch_has_one() -> None:
    """It had the rank of the camera's motion, which drifting LEDs may look like."""
    lights = light_ring(distance_mm=40.0)
    still, level = np.ones((4, ROWS, COLUMNS), np.float32), np.zeros((ROWS, COLUMNS), np.float32)
    evidence = touch_evidence(level, still, level, departure=level, slope=np.stack([level, level]))
    told = ["the images of the LEDs lie"]
    for shifts, words in (CREEP, told), (ONE_OFF, told), (STILL, []):
        shown, true = found(lights, seen(lights, shifts)), np.hypot(*np.ptp(shifts, axis=0))
        measured = creep_and_shift(shown)
        assert sum(measured) == pytest.approx(true / COLUMNS, rel=0.15)
        assert measured[shifts is not ONE_OFF] == 0, "creep has a rank of its own"
        with collect_warnings([]) as notes:
            verdict = judge_touch(evidence, ranks(), shifts=shown)
        assert [note[: len(words[0])] for note in notes] == words
        assert (verdict["check_rest"] < 0.01) == bool(words)
        assert verdict["check_light"] > 0.3
