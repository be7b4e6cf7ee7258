"""Samples of balls: where they lie, and the light that is thrown on them."""

import numpy as np
import pytest

from tactograph.graph.backends.device_call import DeviceCall
from tactograph.graph.backends.opencl import OpenCL
from tactograph.nodes import F4
from tactograph.nodes.calibrate.ball.balls_on_film import Balls
from tactograph.nodes.calibrate.ball.level_touches import level_touches
from tactograph.nodes.calibrate.film.ball_samples import FilmEvidence
from tactograph.nodes.light.film_bounce import film_bounce
from tests.nodes.calibrate.film.test_fit_film import NOISE, PIXEL, RADIUS, RIM, SIZE, press
from tests.nodes.films import LEDS, MATT

MIDDLE = 63.5, 47.5
OUTSIDE = -20.0
"""px from the left border."""
BOUNCING = MATT._replace(albedo=0.7, rim=2.0)
FLAT = np.full((len(LEDS), *SIZE), 0.6, np.float32)


def sampled(
    light: F4,
    albedo: float = 0.7,
    *,
    presses: int = 1,
    column: float = MIDDLE[0],
    flat: F4 = FLAT,
    **options: object,
) -> Balls:
    """Samples of a ball in the middle of each press, or at another column."""
    circle = np.repeat(np.float32([[column, MIDDLE[1], RIM / PIXEL]]), presses, axis=0)
    radius, of = np.full(presses, RADIUS, np.float32), np.arange(presses, dtype=np.int32)
    film = BOUNCING._replace(albedo=albedo)
    placed = np.ones(presses, np.uint8), film.lights, np.ones(len(LEDS), np.float32)
    evidence = FilmEvidence(light, flat, circle, radius, of, *placed, NOISE, PIXEL)
    return evidence.sample(film, **options)


@pytest.mark.one_case
@pytest.mark.parametrize("albedo", [0.0, 0.5, 0.7])
@pytest.mark.parametrize("flat", [FLAT, np.ones_like(FLAT)], ids=["taken", "no_flat_frame"])
def test_light_that_balls_throw_on_the_film_at_rest_is_not_taken_for_drift(
    albedo: float, flat: F4
) -> None:
    """Whatever albedo is assumed when a press is levelled, the LEDs' light stays."""
    raw = press(BOUNCING, (0.0, 0.0), seed=1)
    levelled = level_touches(raw, FLAT, NOISE)
    alone = press(MATT, (0.0, 0.0), seed=1)
    at_rest = np.zeros((1, 3))
    balls = sampled(levelled, albedo, flat=flat, most=None)
    columns, rows = (
        np.rint(w / PIXEL + m).astype(int) for w, m in zip((balls.u, balls.v), MIDDLE, strict=True)
    )
    inner = np.hypot(balls.u, balls.v) < 0.85 * RIM
    remaining = balls.light - balls.thrown(at_rest, BOUNCING) - alone[:, rows, columns]
    taken = (raw - levelled)[:, rows, columns]
    assert np.abs(remaining[:, inner].mean()) < 0.0002
    assert taken[:, inner].mean() > 0.001


def test_a_ball_whose_middle_lies_outside_the_image_throws_light_from_there() -> None:
    raw, alone = (
        press(film, ((OUTSIDE - MIDDLE[0]) * PIXEL, 0.0), seed=1) for film in (BOUNCING, MATT)
    )
    balls = sampled(raw, 0.0, column=OUTSIDE, most=None)
    columns, rows = (
        np.rint(w / PIXEL + m).astype(int) for w, m in zip((balls.u, balls.v), MIDDLE, strict=True)
    )
    true = (raw - alone)[:, rows, columns]
    thrown = balls.thrown(np.zeros((1, 3)), BOUNCING)
    assert thrown.mean() == pytest.approx(true.mean(), rel=0.01)


def test_no_thrown_light_is_computed_for_film_that_throws_none() -> None:
    balls = sampled(press(MATT, (0.0, 0.0), seed=1), 0.0, fine=True)
    for nothing in (balls.bounced, balls.by_lift, balls.by_rim):
        assert nothing.shape == balls.light.shape
        assert not nothing.any()


def test_a_device_computes_the_same_light(device: OpenCL) -> None:
    raw = press(BOUNCING, (0.0, 0.0), seed=1)
    on_host, on_device = (
        sampled(raw, bounce=b) for b in (film_bounce, DeviceCall(film_bounce, device))
    )
    for name in ("light", "bounced", "by_lift", "by_rim"):
        np.testing.assert_allclose(getattr(on_device, name), getattr(on_host, name), atol=2e-4)


def test_thinned_samples_lie_evenly_over_each_ball() -> None:
    one = press(MATT, (0.0, 0.0), seed=1)
    sheet = np.concatenate([one, one], axis=1)
    every = sampled(sheet, 0.0, presses=2, most=None, fine=True)
    some = every.thinned(200)
    for ball in (0, 1):
        of, all_of = some.ball == ball, every.ball == ball
        assert 50 < of.sum() <= 100 < all_of.sum()
        for part, all_of_it in ((some.u, every.u), (some.v, every.v)):
            assert part[of].mean() == pytest.approx(all_of_it[all_of].mean(), abs=0.2)
            assert part[of].std() == pytest.approx(all_of_it[all_of].std(), rel=0.1)
