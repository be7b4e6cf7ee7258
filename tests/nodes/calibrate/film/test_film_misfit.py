"""The misfit of a film's model on a ball that it was not fitted to."""

import warnings
from typing import Any, cast

import numpy as np
import pytest

from tactograph.nodes import F4, Film
from tactograph.nodes.calibrate.ball.balls_on_film import Balls, Fitted
from tactograph.nodes.calibrate.film.film_misfit import MIN_BOUNCE_ERROR, Held
from tests.nodes.scenes import LIGHTS

PIXEL, RADIUS, RIM = 0.1, 6.0, 5.0
LEDS = 60 * LIGHTS
"""In mm."""
SURE = Film.matt(cast(F4, LEDS))._replace(other_lights=cast(F4, np.stack([LEDS] * 8)))
"""A film whose LEDs' places are certain."""


def held(noise: float = 0.0, **changed: Any) -> tuple[Balls, Fitted]:
    """A ball in a film of stated properties, compared with a matt film under the same LEDs."""
    v, u = np.mgrid[-50:51, -50:51] * PIXEL
    inside = np.hypot(u, v) < 0.9 * RIM
    u, v = u[inside], v[inside]
    none = np.zeros((len(LIGHTS), u.size))
    balls = Balls(
        u, v, none, np.zeros(u.size, int), np.zeros((1, 2)), np.array([RIM]), np.array([RADIUS]),
        none, none, none, np.zeros(u.size, int), PIXEL / 2, 2 * RADIUS,
    )  # fmt: skip
    fitted = Fitted.matt(cast(F4, LEDS), np.ones(len(LIGHTS), np.float32), 1)
    true = fitted._replace(film=fitted.film._replace(**changed))
    rng = np.random.default_rng(3)
    light = true.predicted(balls) + rng.normal(0, noise, none.shape)
    return Balls(**{**balls.__dict__, "light": light}), fitted


def test_noise_alone_gives_no_larger_misfit_than_chance() -> None:
    level, _, light, bounce, tilt = Held([held(0.01)], PIXEL).misfit(SURE, 0.0)
    assert level < 2e-3
    assert light < 1e-3
    assert tilt < 1e-3
    assert bounce == 0


def test_diffused_light_that_the_model_does_not_know_makes_all_tilts_too_small() -> None:
    diffuse = np.full(len(LIGHTS), 0.05)
    *_, tilt = Held([held(0.01, diffuse=diffuse)], PIXEL).misfit(SURE, 0.0)
    *_, twice = Held([held(0.01, diffuse=2 * diffuse)], PIXEL).misfit(SURE, 0.0)
    assert tilt > 0.01
    assert twice == pytest.approx(2 * tilt, rel=0.2)


@pytest.mark.parametrize("apart", [0.06, 0.0])
def test_presses_state_an_error_of_the_albedo_even_where_they_agree(
    apart: float,
) -> None:
    (balls, fitted), parts = held(0.01), []
    for albedo in (0.6, 0.6 + apart):
        parts.append((balls, fitted._replace(film=fitted.film._replace(albedo=albedo))))
    # Of two values, the mean's standard deviation and Student's quantile over the normal one.
    doubt = np.hypot(apart / 2 / (0.6 + apart / 2) * 6.3138 / 1.6449, MIN_BOUNCE_ERROR)
    assert Held(parts, PIXEL).misfit(SURE, 0.0)[3] == pytest.approx(doubt, rel=1e-3)


def test_another_place_of_an_led_stays_above_the_film() -> None:
    others = 5 * SURE.other_lights
    others[:, 0, 2] -= 2 * LEDS[0, 2]
    film = SURE._replace(lights=5 * SURE.lights, other_lights=others)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        misfit = Held([held(0.01, diffuse=np.zeros(len(LIGHTS)))], PIXEL).misfit(film, 0.0)
    assert np.isfinite(misfit).all()


def test_chance_hides_only_narrow_errors() -> None:
    """Many pairs of pixels lie far apart, so that wide errors would show."""
    _, width, *_ = Held([held(0.01)], PIXEL).misfit(SURE, 0.0)
    assert width < 0.2 * RIM


def test_few_presses_state_more_than_many() -> None:
    """The misfit on one press predicts that on the next one poorly."""
    part = held(0.01, diffuse=np.full(len(LIGHTS), 0.05))
    *_, one = Held([part], PIXEL).misfit(SURE, 0.0)
    *_, many = Held([part] * 12, PIXEL).misfit(SURE, 0.0)
    assert one > 3 * many


@pytest.mark.parametrize("brighter", [0.02, 0.04])
def test_brightness_that_the_model_does_not_know_makes_a_film_uneven(brighter: float) -> None:
    """All LEDs change alike; noise of single pixels does not count."""
    part = held(0.01, gain=1 + brighter)
    assert Held([part], PIXEL).unevenness() == pytest.approx(2.5 * brighter, rel=0.1)
    assert Held([held(0.01)], PIXEL).unevenness() < 2.5e-3
