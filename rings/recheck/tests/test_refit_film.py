"""A new film is described by one press, if that has the slopes that touches will have."""

import math

import numpy as np
import pytest

from tactograph.graph.errors import collect_warnings
from tactograph.nodes.calibrate.ball.find_balls import FoundBalls
from tactograph.nodes.calibrate.film.fit_film import FilmFit
from tactograph.rings.recheck.nodes.refit_film import refit_film
from tests.nodes.calibrate.film.test_fit_film import (
    FOUR,
    NOISE,
    PIXEL,
    RADIUS,
    RIM,
    SIZE,
    fitted,
    press,
)
from tests.nodes.films import MATT

FLAT = np.full((4, *SIZE), 0.6, np.float32)


@pytest.fixture(scope="module")
def old() -> FilmFit:
    return fitted(MATT, FOUR)


def told_of(old: FilmFit, rim: float) -> list[str]:
    circle = np.array([[63.5, 47.5, rim / PIXEL]], np.float32)
    balls = FoundBalls(circle, np.float32([1]), np.float32([RADIUS]), np.int32([0]), [""])
    with collect_warnings([]) as notes:
        refit_film(
            *(press(MATT, (0, 0), 9), FLAT, FLAT, balls),
            *(old.film, old.misfit, NOISE, PIXEL, PIXEL),
        )
    return notes


def test_a_calibration_keeps_the_steepest_slope_that_was_pressed(old: FilmFit) -> None:
    expected = math.tan(math.asin(RIM / RADIUS))
    assert old.film.pressed_slope == pytest.approx(expected, rel=0.05)


@pytest.mark.slow
def test_a_check_press_much_shallower_than_the_calibrations_gives_a_warning(old: FilmFit) -> None:
    (note,) = told_of(old, 1.5)
    assert "slopes of up to 0.31, the calibration's presses of up to" in note
    assert told_of(old, RIM) == []
    unknown = old._replace(film=old.film._replace(pressed_slope=0.0))
    assert told_of(unknown, 1.5) == []
