"""Judge the ball's radius by the light: does another one explain the presses better?

A wrong radius gives the normals a wrong scale.  LEDs at other distances, a gain of touched film
or a coat can make up for that on the ball, but then the film at rest is not lit as the flat frame
shows it.  So a plain model is fitted with other radii, and balls and flat frame are judged
together.  Where the gel diffuses light, a radius that is too large looks like a gel that diffuses
none.  A pixel size that is wrong by a factor is a radius that is wrong by its inverse.

Long because every doubt says in words what may be wrong and what would agree.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt

from tactograph.graph import InputError, node
from tactograph.nodes import F4, Film, Metrics
from tactograph.nodes.calibrate.film._ball_samples import sample_balls
from tactograph.nodes.calibrate.film._film_at_rest import rest_left
from tactograph.nodes.calibrate.film.balls_on_film import Balls, Fitted
from tactograph.nodes.calibrate.film.film_fit import fit, start_at
from tactograph.nodes.calibrate.film.fit_film import FilmEvidence
from tactograph.nodes.calibrate.lights.light_samples import Rest, rest_of
from tactograph.nodes.optics.film import matt_film

RADIUS_FACTORS = (0.5, 0.6, 0.7, 0.78, 0.86, 0.93, 1.0, 1.07, 1.16, 1.28, 1.45, 1.7, 2.0)
"""Radii that are tried first, relative to the given one; then some between the best two."""
FINER_SHARES, FINER_ROUNDS = (0.35, 0.7), 2
"""Places between the best radius and its neighbours that are tried then, and how often."""
MAX_SAMPLES = 600
"""Samples of the balls; a radius that is worth a warning shows with few."""
PLAIN_PARTS = frozenset({"plain"})
"""Parts of the plain model: a lobe, or light from film to film, can hide a wrong radius."""
USUAL_NEARNESS = 0.2
"""Widths of the image over the distance of an LED from which each fit starts."""
BELIEVED_BELOW, REFUSED_BELOW = 0.6, 0.3
"""Departure, relative to that with the given radius, below which another radius is believed, and
below which the given one is refused."""
HOW_TO_FORCE = "; force=true writes the calibration nevertheless, marked as doubtful"
SMALLER_FACTOR, EQUAL_DEPARTURE = 0.75, 1.1
"""Factor below which a radius counts as another one where the light cannot tell them apart, and the
ratio of what they leave on the balls up to which it cannot."""
MIN_DIFFUSE, GEL_DIFFUSE = 0.05, (0.2, 0.65)
"""Share of diffused light below which a gel has none, and the range of real gels: a radius too
large by a third or more takes it for curvature.  0.3 to 0.5 on two real sensors."""
RADIUS_TOLERANCE = 0.02
"""Relative difference of two radii that counts as none."""
DISTANCE_TOLERANCE = 0.15
"""Tolerated relative difference between the LEDs' distance as found and as given."""


class RadiusVerdict(NamedTuple):
    """Figures, and evidence against the radius, a sentence each."""

    quality: Metrics
    doubts: list[str]


class Tried(NamedTuple):
    """A radius, relative to the given one, and the fit of a plain film with it.

    The departure left on balls and flat frame, that on the balls alone, the LEDs' mean distance
    in mm, and the mean share of light that the gel diffuses.
    """

    factor: float
    departure: float
    on_balls: float
    distance: float
    diffuse: float


class Doubt(NamedTuple):
    """A sentence against a radius, empty if there is none; whether the light contradicts it."""

    sentence: str
    is_clear: bool


_FORMER_INPUTS = (
    *("light", "flat", "circle", "radius", "of"),
    *("kept", "lights", "strength", "noise", "pixel"),
)


@node(former=dict.fromkeys(_FORMER_INPUTS, "give the node 'fit_film' as 'evidence'"))
def judge_radius(
    evidence: FilmEvidence,
    film: Film,
    fitted: Metrics,
    *,
    led_distance_mm: Annotated[float, Gt(0)] | None = None,
    force: bool = False,
    steepest: Annotated[float, Gt(0)] = 3.0,
    shift_px: Annotated[float, Gt(0)] = 0.5,
) -> RadiusVerdict:
    """Fit a plain film with other radii; doubt the given one if another explains the light better.

    Parameters
    ----------
    evidence
        The inputs of `fit_film`.
    film, fitted
        The film that `fit_film` found with the given radius, and its figures.  A radius is
        doubted only if the plain model with another one departs less than this film.
    led_distance_mm
        Mean distance of the LEDs from the middle of the film, where a drawing of the sensor
        gives it.
    force
        Whether a radius that the light contradicts is doubted instead of refused.
    steepest, shift_px
        As for `fit_film`.

    Returns
    -------
    RadiusVerdict
        The figures of `fit_film`; ``light_departure_percent``, what the plain model with the given
        radius leaves of the balls' light and of the flat frame; ``light_radius_mm``, the radius
        of the first ball that explains the light best, where a plain film does.  One doubt if
        another radius explains the light better, or as well with a gel as real ones are, and one
        if the LEDs are found at another distance than given.

    Raises
    ------
    InputError
        If the light contradicts the radius and `force` is not set.
    """
    light, flat, circle, radius, of, kept, lights, strength, noise, pixel = evidence
    used = np.flatnonzero((kept[of] > 0) & (circle[:, 2] > 0))
    balls = sample_balls(
        *(light, flat, circle[used], radius[used], of[used], matt_film(lights), noise, pixel),
        steepest,
        most=MAX_SAMPLES,
        fine=True,
    )
    trials = try_radii(balls, flat, pixel, lights, strength, shift_px)
    first = float(radius[used[0]])
    doubt = doubt_of_radius(trials, first, _left(fitted))
    doubts = [doubt.sentence] if doubt.sentence else []
    if doubt.is_clear and not force:
        raise InputError(doubt.sentence + HOW_TO_FORCE)
    if led_distance_mm is not None:
        mean = float(np.linalg.norm(film.lights, axis=1).mean())
        doubts += _of_distance(mean, led_distance_mm, first, trials)
    quality = fitted | {"light_departure_percent": 100 * as_given(trials).departure}
    if (best := _best(trials)).departure < EQUAL_DEPARTURE * _left(fitted):
        quality["light_radius_mm"] = first * best.factor
    return RadiusVerdict(quality, doubts)


def try_radii(
    balls: Balls,
    flat: F4,
    pixel: float,
    lights: F4,
    strength: F4,
    shift_px: float,
    factors: tuple[float, ...] = RADIUS_FACTORS,
    rounds: int = FINER_ROUNDS,
) -> list[Tried]:
    """Fit the plain film to balls of other radii, by `factors`, and near the best one."""
    rest, width = rest_of(flat, pixel), pixel * flat.shape[2]
    start = start_at(lights, strength, len(balls.centre))
    leds = start.leds.copy()
    leds[:, 2] = USUAL_NEARNESS / width
    start = start.with_leds(leds)
    deepest = min(float((balls.rim / balls.radius).max()), 1.0)

    def tried(factors: Iterable[float]) -> list[Tried]:
        return [_try(balls, rest, start, f, shift_px * pixel, width) for f in factors]

    trials = tried(sorted({deepest, 1.0, *(factor for factor in factors if factor > deepest)}))
    for _ in range(rounds):
        trials = sorted(trials + tried(_beside(_best(trials), trials)))
    return trials


def doubt_of_radius(tried: list[Tried], radius: float, left: float = np.inf) -> Doubt:
    """Return the evidence of the light against a radius; none if it is right.

    Parameters
    ----------
    tried
        As `try_radii` returns it.
    radius
        The radius given, in mm.
    left
        What the film chosen for that radius leaves of the light.
    """
    best, given = _best(tried), as_given(tried)
    is_other = abs(best.factor - 1) > RADIUS_TOLERANCE and best.departure < left
    if is_other and best.departure < BELIEVED_BELOW * given.departure:
        return Doubt(
            f"a ball of {radius * best.factor:.3g} mm radius explains the light better than one of "
            f"{radius:.3g} mm ({best.departure:.1%} left of it instead of {given.departure:.1%}): "
            "is ball_radius_mm its diameter, or pixel_size_mm wrong? Measure both",
            best.departure < min(REFUSED_BELOW * given.departure, BELIEVED_BELOW * left),
        )
    if best.departure < BELIEVED_BELOW * left < np.inf:
        return Doubt(
            f"the film found leaves {left:.1%} of the light of balls and untouched film, and a "
            f"plain one {best.departure:.1%}: check the ball's radius, the pixel size and the "
            "order of the images",
            False,
        )
    smaller = [
        each
        for each in tried
        if each.factor < SMALLER_FACTOR
        and each.on_balls < EQUAL_DEPARTURE * given.on_balls
        and GEL_DIFFUSE[0] < each.diffuse < GEL_DIFFUSE[1]
    ]
    if given.diffuse < MIN_DIFFUSE and smaller:
        usual = max(smaller, key=lambda each: each.factor)
        return Doubt(
            f"with a ball of {radius:.3g} mm radius the gel would diffuse no light; with one of "
            f"{radius * usual.factor:.2g} mm, {usual.diffuse:.0%}, as gels do: is ball_radius_mm "
            "its diameter, or pixel_size_mm wrong? Measure both",
            False,
        )
    return Doubt("", False)


def _left(fitted: Metrics) -> float:
    """The share of the balls' light and of the flat frame that `fit_film` leaves."""
    left = fitted["film_residual_percent"], fitted.get("flat_residual_percent", 0.0)
    return float(np.hypot(*left)) / 100


def _try(
    balls: Balls, rest: Rest | None, start: Fitted, factor: float, shift_mm: float, width_mm: float
) -> Tried:
    """Fit the plain film to balls of other radii and the same contacts."""
    radius = balls.radius * factor
    other = replace(balls, radius=radius, rim=np.minimum(balls.rim, radius))
    fitted = fit(other, rest, PLAIN_PARTS, start, shift_mm, width_mm)
    flat = 0.0 if rest is None else float(np.sqrt(np.square(rest_left(rest, fitted)).mean()))
    distance = float(np.linalg.norm(fitted.film.lights, axis=1).mean())
    diffuse = float(fitted.film.diffuse.mean())
    return Tried(factor, float(np.hypot(fitted.scale, flat)), fitted.scale, distance, diffuse)


def _best(trials: list[Tried]) -> Tried:
    return min(trials, key=lambda each: each.departure)


def as_given(trials: list[Tried]) -> Tried:
    """Return the light's evidence on the given radius."""
    return next(each for each in trials if each.factor == 1)


def _beside(best: Tried, trials: list[Tried]) -> list[float]:
    """Factors between the best one and its neighbours."""
    factors = [each.factor for each in trials]
    at = factors.index(best.factor)
    near = factors[max(at - 1, 0) : at] + factors[at + 1 : at + 2]
    return [best.factor + share * (other - best.factor) for other in near for share in FINER_SHARES]


def _of_distance(found_mm: float, given_mm: float, radius: float, tried: list[Tried]) -> list[str]:
    """A doubt if the LEDs are not where the sensor's drawing has them, with what would agree."""
    if abs(found_mm / given_mm - 1) < DISTANCE_TOLERANCE:
        return []
    agreeing = [each for each in tried if abs(each.distance / given_mm - 1) < DISTANCE_TOLERANCE]
    contradiction = (
        f"the LEDs are found {found_mm:.4g} mm from the film's middle, not {given_mm:.4g} mm: "
    )
    if agreeing and abs((best := _best(agreeing)).factor - 1) > RADIUS_TOLERANCE:
        return [contradiction + f"a ball_radius_mm of {radius * best.factor:.3g} would agree"]
    share = given_mm / found_mm
    return [
        contradiction
        + f"ball_radius_mm and pixel_size_mm would agree if both were {share:.3g} times as "
        "large; or led_distance_mm is wrong"
    ]
