"""The bend of a film at rest, by a model of its light that has a coat.

A coat's mirror images and what the film throws on itself change the light as a bend does.  Fitted
at once they are separated, since the flat frame shows both over the whole film.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tactograph.sdk import F8, Film, InputError, NodeCall
from tactograph.sdk.unstable import (
    DERIVATIVE_STEP,
    MAX_ROUNDS,
    FilmEvidence,
    Fitted,
    Fitting,
    Odds,
    RestShape,
)

COATED_PARTS = frozenset(("lobe",)), frozenset(("lobe", "bounce"))
"""Parts of a film with a coat, and of one that lights itself as well."""


class Bending(NamedTuple):
    """What a bend is fitted to, and how its unknowns make a shape and lay balls on it."""

    unit: F8
    """Unit of each unknown."""
    is_stated: bool
    """Whether the height of the camera's pupil is given."""
    shape: Callable[[F8], RestShape]
    lay: Callable[[F8], FilmEvidence]
    """The evidence with balls found, and LEDs placed, on a film of some bend."""
    bounce: NodeCall


class _Round(NamedTuple):
    """A fit of one model on a film of some shape."""

    laid: FilmEvidence
    fitting: Fitting
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
    coat = Fitting.of(matt.fitting.balls, matt.fitting.rest, COATED_PARTS[0])
    now = matt._replace(fitted=coat.fitted(matt.fitted))
    more = len(coat.unknowns.names) - len(matt.fitting.unknowns.names)
    if not Odds.of(matt.fitted.scale, now.fitted.scale, more, independent).are_sure:
        return None
    if not bending.is_stated:
        raise InputError(
            "the film has a coat, and what that mirrors from near looks like a bend: to find both, "
            "give `camera_mm`, the height of the camera's pupil above the film (1e6: far away)"
        )
    for parts in COATED_PARTS:
        for _ in range(MAX_ROUNDS):
            now = _round(bending, unknowns, parts, now.fitted)
            light, flat = _further(bending, unknowns, now)
            step, spread = now.fitting.further_step(now.fitted, light, flat)
            unknowns = unknowns + bending.unit * step
            if (np.square(step) < np.diag(spread)).all():
                break
    balls = now.fitting.balls
    for number in np.unique(balls.ball):
        others = balls.ball != number
        without = now.fitting._replace(balls=balls.only(others))
        moved = without.further_step(now.fitted, light[..., others], flat)[0] - step
        spread = spread + np.outer(moved, moved) * (1 - 1 / len(now.laid.radius))
    return unknowns, spread * np.outer(bending.unit, bending.unit)


def _round(bending: Bending, unknowns: F8, parts: frozenset[str], before: Fitted | None) -> _Round:
    """Fit a model's film, LEDs and balls on a bend."""
    laid = bending.lay(unknowns)
    start, film = laid.start(), Film.matt(laid.first_lights)
    if before is not None:
        film, start = before.film, before._replace(shifts=np.zeros_like(before.shifts))
    assert laid.shape is not None  # what `lay` lays balls on
    camera = laid.shape.camera
    film, start = (
        film._replace(camera=camera),
        start._replace(film=start.film._replace(camera=camera)),
    )
    bounces = "bounce" in parts
    balls = laid.sample(film, fine=not bounces, bounce=bending.bounce)
    rest = laid.rest(bending.bounce if bounces else None, film)
    fitting = Fitting.of(balls, rest, parts)
    return _Round(laid, fitting, fitting.fitted(start))


def _further(bending: Bending, unknowns: F8, now: _Round) -> tuple[F8, F8]:
    """Derivatives of light and flat frame by the unknowns of the bend, in their units."""
    fitted, fitting = now.fitted, now.fitting
    assert fitting.rest is not None  # `find_rest` refuses a uniform flat frame
    light, flat = fitted.predicted(fitting.balls), fitted.rest_residual(fitting.rest)
    by_light, by_flat = [], []
    for way in np.eye(len(unknowns)):
        shape = bending.shape(unknowns + DERIVATIVE_STEP * bending.unit * way)
        balls = now.laid._replace(shape=shape).laid(fitting.balls)
        by_light.append((fitted.predicted(balls) - light) / DERIVATIVE_STEP)
        rest = replace(fitting.rest, beneath=shape.at(fitting.rest.x, fitting.rest.y))
        by_flat.append((fitted.rest_residual(rest) - flat) / DERIVATIVE_STEP)
    return np.stack(by_light), np.stack(by_flat)
