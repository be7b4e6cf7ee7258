"""Labels are kept unless they increase the error of balls, on a film that diffuses light."""

import numpy as np
import pytest

from tactograph.nodes import F4, Film
from tactograph.nodes.calibrate.ball.find_balls import FoundBalls
from tactograph.nodes.calibrate.rating.judge_labels import (
    CAUTIOUS_TURN_RAD,
    LabelGain,
    judge_labels,
)
from tactograph.nodes.optics.film import predict
from tactograph.nodes.simulate.render import render
from tactograph.nodes.simulate.shape_ball import shape_ball
from tactograph.nodes.slope.height_slopes import height_slopes

LIGHTS = np.array([[20, 18, 25], [-19, 21, 25], [-20, -18, 26], [19, -20, 25]], np.float32)
PIXEL, RADIUS = 0.05, 2.0
BALL = shape_ball(
    radius_mm=RADIUS, rise_mm=1.2, width_px=200, height_px=200, pixel_size_mm=PIXEL
).height
FLAT = np.full((4, *BALL.shape), 0.5, np.float32)
CONTACT_PX = float(np.sqrt((BALL > 0).sum() / np.pi))
BALLS = FoundBalls(
    np.array([[99.5, 99.5, CONTACT_PX]], np.float32),
    np.ones(1, np.float32),
    np.array([RADIUS], np.float32),
    np.zeros(1, np.int32),
    ["ball"],
)


STRAY_LIGHT = np.float32(0.04)
"""Light in shadows; LEDs without any are certainly in shadow and left out anyway."""
HIGH = LIGHTS * np.float32([1, 1, 4])
"""LEDs so high that nothing is in shadow."""


def light_on(film: Film) -> F4:
    """The light of the ball, K x H x W, without cast shadows."""
    rows, columns = np.indices(BALL.shape, np.float32)
    middle = (np.array(BALL.shape) - 1) / 2
    x, y = (columns - middle[1]) * PIXEL, (rows - middle[0]) * PIXEL
    p, q = height_slopes(BALL, PIXEL).slope
    normals = np.stack([-p, -q, np.ones_like(p)]) / np.sqrt(1 + p * p + q * q)
    light = predict(film, normals.reshape(3, -1), x.ravel(), y.ravel(), BALL.ravel())
    return np.asarray(light, np.float32).reshape(4, *BALL.shape)


def judged(lights: F4 = LIGHTS, diffused: float = 0.4, wrap: float = 0.0) -> LabelGain:
    """The gain of labels with `wrap` of the light behind the terminator."""
    share = np.full(4, diffused, np.float32)
    film = Film.matt(lights)._replace(diffuse=share, wrap=wrap, uneven=0.02, grain=0.002)
    if wrap:
        matt = light_on(film._replace(diffuse=0 * share))
    else:
        level = np.zeros_like(BALL)
        matt = np.asarray(render(BALL, PIXEL, lights).light / render(level, PIXEL, lights).light)
    matt = np.maximum(matt, STRAY_LIGHT)
    light = np.float32(diffused) + np.float32(1 - diffused) * matt
    noise = np.float32([0, 0.25e-6])
    return judge_labels(FLAT * light, light, matt, FLAT, BALL, film, BALLS, noise, PIXEL)


def test_labels_of_shadows_that_follow_the_model_are_kept() -> None:
    gain = judged()
    assert gain.turn == 0
    assert gain.quality["labels_gain_deg"] > 0


def test_labels_that_increase_the_error_are_set_for_absurd_light_only() -> None:
    """An LED behind the terminator still carries evidence, which is lost if it is left out."""
    gain = judged(wrap=0.1)
    assert gain.turn == pytest.approx(CAUTIOUS_TURN_RAD)
    assert gain.quality["labels_gain_deg"] < -0.1


def test_balls_without_a_shadow_give_no_verdict_and_labels_are_kept() -> None:
    assert judged(HIGH) == LabelGain(0.0, {"labels_gain_deg": 0.0})


def test_labels_are_not_judged_on_a_film_that_diffuses_no_light() -> None:
    assert judged(diffused=0.0) == LabelGain(0.0, {})
