"""Rows that were put together: torn and interlaced frames."""

import cv2
import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.trust.line_changes import line_changes
from tactograph.nodes.trust.touch_evidence import touch_evidence
from tests.nodes.trust.law import by_name

H, W = 120, 160
FILM = np.ones((H, W), np.uint8)
Y, X = np.mgrid[:H, :W].astype(np.float32)


def ball(x: float, y: float) -> F4:
    """The light of three colours on a ball that is pressed there."""
    p, q = ((c - at) / 60 for c, at in ((X, x), (Y, y)))
    inside = np.clip((25 - np.hypot(X - x, Y - y)) / 4, 0, 1)
    around = (2 * np.pi * k / 3 for k in range(3))
    light = [1 + inside * (np.cos(a) * p + np.sin(a) * q) for a in around]
    return np.asarray(light, np.float32)


def seen(light: F4, noise: float = 0.01) -> F4:
    return light + np.random.default_rng(1).normal(0, noise, light.shape).astype(np.float32)


def of_lines(light: F4, area: F4 = FILM) -> float:
    """Change across the worst row over that along it, less what columns change alike."""
    plain = touch_evidence(np.full((H, W), -1, np.float32), np.ones_like(light), 0 * light[0])
    return by_name(plain, lines=line_changes(light, area))["lines"]


def figure(light: F4, area: F4 = FILM) -> float:
    return of_lines(seen(light), area)


BALL, OTHER = ball(70, 60), ball(95, 50)
TORN, INTERLACED, DEAD = BALL.copy(), BALL.copy(), BALL.copy()
TORN[:, 105:] *= np.float32([1.12, 0.9, 1.0])[:, None, None]
INTERLACED[:, ::4] = OTHER[:, ::4]
DEAD[:, 77] = 0.5


@pytest.mark.parametrize("light", [TORN, INTERLACED, DEAD], ids=["torn", "interlaced", "dead row"])
def test_rows_that_do_not_belong_together_are_found(light: F4) -> None:
    assert figure(light) > 2
    assert figure(light.swapaxes(1, 2), FILM.T) < 1.6, "cameras read rows"


def test_a_surface_with_edges_along_the_rows_is_one() -> None:
    """As a bar across the whole frame, seen through film and lens."""
    bar = 1 + 0.4 * ((Y > 40).astype(np.float32) - (Y > 44))
    blurred = np.repeat(cv2.GaussianBlur(bar, (0, 0), 1.5)[None], 3, axis=0)
    for light in (BALL, np.ones_like(BALL), blurred):
        assert figure(light) < 1.6


def test_compression_draws_lines_both_ways() -> None:
    coded = cv2.imencode(".jpg", np.rint(160 * seen(BALL)).transpose(1, 2, 0))[1]
    image = np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), np.float32).transpose(2, 0, 1) / 160
    assert of_lines(image) < 1.6


def test_pixels_without_film_do_not_count() -> None:
    black = BALL.copy()
    black[:, 100:] = 0
    assert figure(black) > 3.6
    assert figure(black, (Y < 100).astype(np.uint8)) < 1.6
