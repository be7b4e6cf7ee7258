"""The bend of a film at rest, by a model of its light that has a coat.

A coat's mirror images and what the film throws on itself change the light as a bend does.  Fitted
at once they are separated, since the flat frame shows both over the whole film.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tactograph.sdk import F4, F8, Film, InputError, Light, NodeCall
from tactograph.sdk.unstable import (
    DERIVATIVE_STEP,
    MAX_ROUNDS,
    PART_UNKNOWNS,
    SURE_ODDS,
    BallPress,
    BallRadii,
    Balls,
    Fitted,
    Further,
    Noise,
    Rest,
    RestShape,
    SheetLight,
    bounced_at_rest,
    fit,
    further_step,
    laid_on,
    log_odds,
    predicted,
    rest_residual,
    sample_balls,
    start_at,
)

COATED_PARTS = frozenset(("lobe",)), frozenset(("lobe", "bounce"))
"""Parts of a film with a coat, and of one that lights itself as well."""


class Laid(NamedTuple):
    """Balls found on a film of some shape, B x 3 in px, and LEDs of a matt film, K x 3 and K."""

    shape: RestShape
    circle: F4
    lights: F4
    strength: F4


class Bending(NamedTuple):
    """What a bend is fitted to, and how its unknowns make a shape and lay balls on it."""

    light: SheetLight
    flat: Light
    radius: BallRadii
    of: BallPress
    noise: Noise
    pixel: float
    unit: F8
    """Unit of each unknown."""
    is_stated: bool
    """Whether the height of the camera's pupil is given."""
    shape: Callable[[F8], RestShape]
    lay: Callable[[F8], Laid]
    bounce: NodeCall


class _Round(NamedTuple):
    """A fit of one model on a film of some shape."""

    laid: Laid
    balls: Balls
    rest: Rest
    fitted: Fitted


def coated_bend(bending: Bending, unknowns: F8, independent: float) -> tuple[F8, F8] | None:
    """Return the unknowns of the bend under a coat and their covariance; None without a coat.

    A film has one where it explains the balls' light better by sure odds, for as many
    `independent` samples.  The covariance is that of least squares, and as much as the bend moves
    when each ball is left out (the jackknife).

    Raises
    ------
    InputError
        If the film has one, and the height of the pupil is not given.
    """
    matt = _round(bending, unknowns, frozenset(), None)
    coat = fit(matt.balls, matt.rest, COATED_PARTS[0], matt.fitted)
    now = matt._replace(fitted=coat)
    more = len(PART_UNKNOWNS["lobe"])
    if log_odds(matt.fitted.scale, coat.scale, more, independent) < math.log(SURE_ODDS):
        return None
    if not bending.is_stated:
        raise InputError(
            "the film has a coat, and what that mirrors from near looks like a bend: to find both, "
            "give `camera_mm`, the height of the camera's pupil above the film (1e6: far away)"
        )
    for parts in COATED_PARTS:
        for _ in range(MAX_ROUNDS):
            now = _round(bending, unknowns, parts, now.fitted)
            further = _further(bending, unknowns, now)
            step, spread = _step(bending, now, parts, further)
            unknowns = unknowns + bending.unit * step
            if (np.square(step) < np.diag(spread)).all():
                break
    for number in np.unique(now.balls.ball):
        others = now.balls.ball != number
        remaining = Further(further.light[..., others], further.flat)
        without = now._replace(balls=now.balls.only(others))
        moved = _step(bending, without, parts, remaining)[0] - step
        spread = spread + np.outer(moved, moved) * (1 - 1 / len(bending.radius))
    return unknowns, spread * np.outer(bending.unit, bending.unit)


def _round(bending: Bending, unknowns: F8, parts: frozenset[str], before: Fitted | None) -> _Round:
    """Fit a model's film, LEDs and balls on a bend."""
    laid = bending.lay(unknowns)
    start = start_at(laid.lights, laid.strength, len(laid.circle))
    film = Film.matt(laid.lights)
    if before is not None:
        film, start = before.film, before._replace(shifts=np.zeros_like(before.shifts))
    camera = laid.shape.camera
    film, start = (
        film._replace(camera=camera),
        start._replace(film=start.film._replace(camera=camera)),
    )
    balls = sample_balls(
        bending.light, bending.flat, laid.circle, bending.radius, bending.of, film, bending.noise,
        bending.pixel, fine="bounce" not in parts, bounce=bending.bounce, shape=laid.shape,
    )  # fmt: skip
    glow = bounced_at_rest(laid.shape, film, bending.bounce) if "bounce" in parts else None
    rest = Rest.of(bending.flat, bending.pixel, laid.shape, glow)
    assert rest is not None  # `find_rest` refuses a uniform flat frame
    fitted = fit(balls, rest, parts, start)
    return _Round(laid, balls, rest, fitted)


def _step(bending: Bending, now: _Round, parts: frozenset[str], further: Further) -> tuple[F8, F8]:
    return further_step(now.balls, now.rest, parts, now.fitted, further)


def _further(bending: Bending, unknowns: F8, now: _Round) -> Further:
    """Derivatives of the light by the unknowns of the bend, in their units."""
    light, flat = predicted(now.balls, now.fitted), rest_residual(now.rest, now.fitted)
    by_light, by_flat = [], []
    for way in np.eye(len(unknowns)):
        shape = bending.shape(unknowns + DERIVATIVE_STEP * bending.unit * way)
        balls = laid_on(now.balls, now.laid.circle, shape)
        by_light.append((predicted(balls, now.fitted) - light) / DERIVATIVE_STEP)
        rest = replace(now.rest, beneath=shape.at(now.rest.x, now.rest.y))
        by_flat.append((rest_residual(rest, now.fitted) - flat) / DERIVATIVE_STEP)
    return Further(np.stack(by_light), np.stack(by_flat))
