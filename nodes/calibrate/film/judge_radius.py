"""Judge by the light what was told of a ball and a camera: do other values explain it better?

A wrong radius gives the normals a wrong scale.  LEDs at other distances, a gain of touched film
or a gel that diffuses light can make up for that on the ball, but then the film at rest is not lit
as the flat frame shows it.  So a plain film is fitted to balls and flat frame together, once with
the values told, and once with each of them free: the radius, the pupil's height, the camera's
gamma.  Whichever leaves less is likelier, by odds that are those of the residuals' likelihoods.
A pixel size that is wrong by a factor is a radius that is wrong by its inverse.

Up to the third power of the slope, a ball that is too small looks like a gel that diffuses light.
So where the gel seems to diffuse some, a last fit has a free radius and a gel that diffuses none.
If the light does not exclude it, the radius told is not confirmed, and the heights' scale is as
uncertain as these two are apart.

Long because every doubt says in words what may be wrong and what would agree.
"""

import math
from collections.abc import Iterable
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt

from tactograph.graph import InputError, node
from tactograph.nodes import F4, Film, Metrics, ScaleError
from tactograph.nodes.calibrate.ball.ball_surface import sunk
from tactograph.nodes.calibrate.ball.balls_on_film import Balls, Fitted
from tactograph.nodes.calibrate.film.ball_samples import sample_balls, thinned
from tactograph.nodes.calibrate.film.film_at_rest import MAX_INDEPENDENT_REST, rest_residual
from tactograph.nodes.calibrate.film.film_fit import fit, start_at
from tactograph.nodes.calibrate.film.film_unknowns import STATED_UNKNOWNS, USUAL_NEARNESS
from tactograph.nodes.calibrate.film.fit_film import FilmEvidence
from tactograph.nodes.calibrate.lights.light_samples import rest_of
from tactograph.nodes.calibrate.rating.verdict import SURE_ODDS
from tactograph.nodes.optics.film import matt_film
from tactograph.nodes.optics.rest_shape import RestShape

MAX_SAMPLES = 600
"""Samples of the balls; a radius that is worth a warning shows with few."""
FIRST_SIZES = (0.5, 1.0, 2.0)
"""Radii from which a free one starts, over that told: radius and diameter are easily confused."""
REFUSED_ODDS = SURE_ODDS**3
"""Odds from which nothing else is possible, as if three sure signs spoke for it."""
SAME_SIZE = 0.02
"""Relative difference up to which two radii count as equal."""
DISTANCE_TOLERANCE = 0.15
"""Tolerated relative difference between the LEDs' distance as found and as given."""
FORCE_ADVICE = "; `force`=true writes the calibration nevertheless, marked as doubtful"
CAMERA_ADVICE = ", or the camera near the film, whose height you have not given (`film.camera`=MM)"
RADIUS_INPUTS = " (`evidence.radius`, `evidence.pixel`)"

OTHER_SIZE, OTHER_POWER = STATED_UNKNOWNS
AS_STATED, OTHER_CAMERA, CLEAR_GEL, WITH_COAT = "stated", "camera", "clear", "coated"
FREE_PARTS = {
    name: frozenset({"plain", name} - {AS_STATED})
    for name in (AS_STATED, OTHER_SIZE, OTHER_POWER, OTHER_CAMERA)
}
FREE_PARTS[CLEAR_GEL] = frozenset({"touched", OTHER_SIZE})
FREE_PARTS[WITH_COAT] = frozenset({"plain", "lobe"})
"""The parts of a plain film that are fitted, by what is free; a lobe, or light from film to film,
can hide a wrong radius."""


class Explained(NamedTuple):
    """What a plain film explains of the light where a value is free.

    The balls' radius over that told, the power to which the camera raises the light, one over the
    pupil's height; the departure left on balls and flat frame, the LEDs' mean distance in mm, the
    mean share of light that the gel diffuses.
    """

    size: float
    power: float
    camera: float
    departure: float
    distance: float
    diffuse: float


class Alternatives(NamedTuple):
    """What each of `FREE_PARTS` explains, and how many independent values the light counts as.

    `cap` is how high the balls are if their radius is another, over their height if it is as told.
    """

    by_name: dict[str, Explained]
    values: float
    cap: dict[str, float]

    def odds(self, name: str, over: float | None = None) -> float:
        """Return how much likelier an alternative is than what was told, or than a departure.

        The likelihood of n residuals of unknown spread goes as the spread to the power of -n.
        """
        over = self.by_name[AS_STATED].departure if over is None else over
        digits = self.values * math.log10(over / self.by_name[name].departure)
        return float(10.0 ** min(digits, 300.0))


class JudgedRadius(NamedTuple):
    """A `Judged`, and the relative error of the heights' scale that the light leaves open."""

    quality: Metrics
    doubts: list[str]
    unconfirmed: str
    scale_error: ScaleError


@node
def judge_radius(
    evidence: FilmEvidence,
    film: Film,
    fitted: Metrics,
    of_pixels: list[str] | None = None,
    others: list[str] | None = None,
    rest_error: ScaleError | None = None,
    *,
    led_distance_mm: Annotated[float, Gt(0)] | None = None,
    force: bool = False,
) -> JudgedRadius:
    """Fit a plain film with other values than those told; doubt these if others are likelier.

    Parameters
    ----------
    evidence : the inputs of `fit_film`
    film, fitted
        The film that `fit_film` found with the values told, and its figures.  They are doubted
        only if this film is not surely likelier than the plain one with other values.
    of_pixels
        Doubts of the pixels' sides.  They may be the cause, so that the radius is not refused.
    others
        Doubts of images, flat frame and the film's shape; named in place of the radius, which they
        spoil.
    rest_error
        Relative error of the heights by a film at rest that is not well known; a plane is.
    led_distance_mm
        Mean distance of the LEDs from the middle of the film, where a drawing of the sensor
        gives it.
    force : whether a radius that the light contradicts is doubted instead of refused

    Returns
    -------
    The figures of `fit_film`; ``light_departure_percent``, what the plain film with the values told
    leaves of the balls' light and of the flat frame; ``light_radius_mm``, the radius of the first
    ball that explains the light best, where a plain film does; ``scale_error_percent``.  One doubt
    if other values are likelier, or if the light does not confirm the radius, and one if the LEDs
    are found at another distance than given.

    Raises
    ------
    InputError
        If the light contradicts the values told and `force` is not set.
    """
    light, flat, circle, radius, of, is_used, lights, strength, noise, pixel, shape = evidence
    used = np.flatnonzero((is_used[of] > 0) & (circle[:, 2] > 0))
    balls = sample_balls(
        *(light, flat, circle[used], radius[used], of[used], matt_film(lights), noise, pixel),
        most=None,
        fine=True,
        shape=shape,
    )
    first, percent = float(radius[used[0]]), _unexplained_percent(fitted)
    # On a film that is no plane, the pupil is where its shape was seen from.
    camera = film.camera if shape is None else film.camera or None
    alternatives = explain(balls, flat, pixel, lights, strength, shape, camera)
    doubts, is_clear = doubts_of(alternatives, first, percent, RADIUS_INPUTS)
    if is_clear and not (force or of_pixels):
        raise InputError([*(others or []), *doubts][0] + FORCE_ADVICE)
    scale, is_open = scale_error(alternatives, percent), ""
    if led_distance_mm is not None:
        mean = float(np.linalg.norm(film.lights, axis=1).mean())
        doubts += _of_distance(mean, led_distance_mm, first, alternatives)
        scale = scale if doubts else 0.0
    elif not doubts:
        advice = ", or give `led_distance_mm`=MM"
        is_open = unconfirmed(alternatives, first, percent, RADIUS_INPUTS, advice)
        # The small balls of a grid throw no shadow, however deep they are pressed.
        doubts += [is_open] * bool(is_open and np.bincount(of[used]).max() == 1)
    scale = math.hypot(scale, rest_error or 0.0)
    departure = alternatives.by_name[AS_STATED].departure
    quality = fitted | {"light_departure_percent": 100 * departure}
    quality["scale_error_percent"] = 100 * scale
    if alternatives.odds(OTHER_SIZE, percent) > 1 / SURE_ODDS:
        likelier = _is_other(alternatives) and alternatives.odds(OTHER_SIZE) > SURE_ODDS
        quality["light_radius_mm"] = first * (
            alternatives.by_name[OTHER_SIZE].size if likelier else 1
        )
    return JudgedRadius(quality, doubts, is_open, scale)


def explain(
    balls: Balls,
    flat: F4,
    pixel: float,
    lights: F4,
    strength: F4,
    shape: RestShape | None = None,
    camera: float | None = 0.0,
    coated: bool = False,
) -> Alternatives:
    """Fit the plain film with the values told and with each of them free.

    Parameters
    ----------
    balls, flat, pixel, lights, strength, shape
        Samples as `sample_balls` returns them, and what else `fit_film` is given.
    camera
        One over the pupil's height above the film; 0: it is free.  None: the camera is far.
    coated : whether a film with a coat is tried, too, with the values told
    """
    rest, width = rest_of(flat, pixel, shape), pixel * flat.shape[2]
    start = start_at(lights, strength, len(balls.centre))
    leds = start.leds.copy()
    leds[:, 2] = USUAL_NEARNESS / width
    start = start._replace(film=start.film._replace(camera=camera or 0.0)).with_leds(leds)
    samples = thinned(balls, MAX_SAMPLES)

    def fitted(parts: frozenset[str], start: Fitted) -> Fitted:
        return fit(samples, rest, parts, start)

    def explained(now: Fitted) -> tuple[Explained, bool]:
        """What a fit leaves, and whether it has given the flat frame up."""
        flat = 0.0 if rest is None else float(np.sqrt(np.square(rest_residual(rest, now)).mean()))
        departure = float(np.hypot(now.scale, flat))
        distance = float(np.linalg.norm(now.film.lights, axis=1).mean())
        values = now.size, now.power, now.film.camera, departure, distance
        return Explained(*values, float(now.film.diffuse.mean())), flat > now.scale

    def starts(parts: frozenset[str]) -> list[Fitted]:
        if OTHER_CAMERA in parts:
            near = start.film._replace(camera=USUAL_NEARNESS / width)
            return [start, start._replace(film=near)]
        return [
            start._replace(size=size) for size in (FIRST_SIZES if OTHER_SIZE in parts else (1.0,))
        ]

    def candidates(parts: frozenset[str]) -> Iterable[Explained]:
        # What a fit leaves of the flat frame counts as the flat frame's own error.  One that
        # leaves more there than on the balls may depart less from a matt film on.
        for first in starts(parts):
            best, has_failed = explained(fitted(parts, first))
            yield best
            if has_failed:
                yield explained(fitted(parts, fitted(frozenset(), first)))[0]

    excluded = {OTHER_CAMERA: camera != 0, WITH_COAT: not coated}
    free = {name: parts for name, parts in FREE_PARTS.items() if not excluded.get(name)}
    by_name = {
        name: min(candidates(parts), key=lambda each: each.departure)
        for name, parts in free.items()
    }
    # A camera that is found far away is as told, and its fit may end in a lower minimum.
    if (far := by_name.get(OTHER_CAMERA)) is not None and far.camera == 0:
        by_name[AS_STATED] = min(by_name[AS_STATED], far, key=lambda each: each.departure)
    values = min(samples.light.size, MAX_INDEPENDENT_REST * len(lights))
    cap = {
        name: _cap(balls, by_name[name].size) / _cap(balls, 1.0) for name in (OTHER_SIZE, CLEAR_GEL)
    }
    return Alternatives(by_name, values, cap)


def doubts_of(
    fits: Alternatives, radius: float, misfit: float = math.inf, which: str = ""
) -> tuple[list[str], bool]:
    """Return at most one doubt of what was told, and whether the light contradicts it.

    Parameters
    ----------
    fits : as `explain` returns it
    radius : the radius given, in mm
    misfit : what the film chosen for the values told leaves of the light
    which : in brackets, where radius and pixel size are given
    """
    others = [name for name in (OTHER_SIZE, OTHER_CAMERA, OTHER_POWER) if _is_other(fits, name)]
    likely = [
        name
        for name in others
        if fits.odds(name) > SURE_ODDS and fits.odds(name, misfit) > 1 / SURE_ODDS
    ]
    likely = sorted(likely, key=lambda name: fits.by_name[name].departure)
    if likely:
        best, *rest = likely
        least = fits.by_name[best].departure
        alike = [name for name in rest if fits.odds(name, least) > 1 / REFUSED_ODDS]
        stated_departure = fits.by_name[AS_STATED].departure
        doubt = (
            f"{_value(fits, best, radius)} explains the light better than "
            f"{_in_words(best, radius)}, {_times(fits.odds(best))} likelier "
            f"({least:.1%} unexplained instead of {stated_departure:.1%})"
            + "".join(f"; so does {_value(fits, name, radius)}" for name in alike)
            + _cure(fits, best, which)
        )
        return [doubt], min(fits.odds(best), fits.odds(best, misfit)) > REFUSED_ODDS
    stated = fits.by_name[AS_STATED].departure
    if misfit < math.inf and fits.odds(AS_STATED, misfit) > REFUSED_ODDS:
        doubt = (
            f"no model of the film explains balls and untouched film together: the best leaves "
            f"{misfit:.1%} of the light unexplained, where a plain film leaves {stated:.1%}. Check "
            f"the order of the images, the focus, the ball's radius and the pixel size{which}"
        )
        return [doubt], False
    return [], False


def unconfirmed(
    fits: Alternatives,
    radius: float,
    misfit: float = math.inf,
    which: str = "",
    advice: str = "",
) -> str:
    """Return what is open if a gel that diffuses no light is not excluded, with another radius."""
    open_ones = _open_ones(fits, misfit)
    others = []
    if CLEAR_GEL in open_ones:
        others.append(f"{radius * fits.by_name[CLEAR_GEL].size:.3g} mm if it diffuses none")
    if OTHER_SIZE in open_ones:
        size, times = fits.by_name[OTHER_SIZE], _times(fits.odds(OTHER_SIZE))
        likelier = (
            f"{radius * size.size:.3g} mm, {times} likelier, if it diffuses {size.diffuse:.0%}"
        )
        others.append(likelier)
    if not others:
        return ""
    return (
        f"the light does not confirm the ball's radius: {radius:.3g} mm fits if the gel diffuses "
        f"{fits.by_name[AS_STATED].diffuse:.0%} of the light, {', '.join(others)}. Heights may be "
        f"{scale_error(fits, misfit):.0%} off. Measure the ball and the pixel size{which}, or "
        f"press deeper, until the ball throws a shadow on itself{advice}"
    )


def scale_error(fits: Alternatives, misfit: float = math.inf) -> float:
    """Return by what share the balls may be higher or lower than told; 0 if that is confirmed.

    Either the radius is another, or the pixel size is, by the inverse: then all heights change by
    that once more.  Neither is likelier, so the squares of both are averaged.
    """
    either = [
        (fits.cap[name], fits.cap[name] / fits.by_name[name].size)
        for name in _open_ones(fits, misfit)
    ]
    return max((math.hypot(a - 1, b - 1) / math.sqrt(2) for a, b in either), default=0.0)


def _open_ones(fits: Alternatives, misfit: float) -> list[str]:
    """The alternatives with other radii that the light leaves open.

    A gel that diffuses none is the simplest, and open until it is excluded.  One that diffuses some
    explains anything that it does better by chance, and is open if it is half way to sure.
    """
    from_odds = {CLEAR_GEL: 1 / SURE_ODDS, OTHER_SIZE: math.sqrt(SURE_ODDS)}
    return [
        name
        for name, least in from_odds.items()
        if _is_other(fits, name)
        and fits.odds(name) > least
        and fits.odds(name, misfit) > 1 / SURE_ODDS
    ]


def _is_other(fits: Alternatives, name: str = OTHER_SIZE) -> bool:
    """Whether an alternative is another value than that told."""
    if name not in fits.by_name:
        return False
    each = fits.by_name[name]
    value = {
        OTHER_SIZE: each.size,
        CLEAR_GEL: each.size,
        OTHER_POWER: each.power,
        OTHER_CAMERA: 1 + each.camera,
    }[name]
    return bool(abs(value - 1) > (0 if name == OTHER_CAMERA else SAME_SIZE))


def _value(fits: Alternatives, name: str, radius: float) -> str:
    each = fits.by_name[name]
    if name == OTHER_SIZE:
        return f"a ball of {radius * each.size:.3g} mm radius"
    if name == OTHER_POWER:
        return f"light that the camera raises to the power of {each.power:.3g}"
    return f"a camera {1 / each.camera:.3g} mm above the film"


def _in_words(name: str, radius: float) -> str:
    if name == OTHER_SIZE:
        return f"one of {radius:.3g} mm"
    return "linear light" if name == OTHER_POWER else "one far away"


def _cure(fits: Alternatives, name: str, which: str) -> str:
    """What to do about the likeliest alternative."""
    if name == OTHER_CAMERA:
        return ": give its height (`film.camera`=MM), or a lens"
    if name == OTHER_POWER:
        return ": the camera's values are not linear: switch its gamma and contrast off"
    size = fits.by_name[OTHER_SIZE].size
    wrong = "too large" if size < 1 else "too small"
    if size < FIRST_SIZES[0] ** 0.5:
        wrong = "its diameter"
    return (
        f": is the radius given {wrong}, or the pixel size too "
        f"{'small' if size < 1 else 'large'}, as by another zoom"
        + CAMERA_ADVICE * (OTHER_CAMERA in fits.by_name)
        + f"? Measure radius and pixel size{which}"
    )


def _times(odds: float) -> str:
    """Odds in words, to a digit."""
    if odds > REFUSED_ODDS:
        return "over a billion times"
    digits = math.floor(math.log10(odds))
    return f"{round(odds, -digits):,.0f} times"


def _cap(balls: Balls, size: float) -> float:
    """The mean height in mm of balls of `size` times the radius, in the same contacts."""
    sized = balls.sized(size)
    return float((sized.radius - sunk(sized.radius, sized.rim)).mean())


def _unexplained_percent(fitted: Metrics) -> float:
    """The share of the balls' light and of the flat frame that `fit_film` leaves."""
    misfit = fitted["film_residual_percent"], fitted.get("flat_residual_percent", 0.0)
    return float(np.hypot(*misfit)) / 100


def _of_distance(
    fitted_mm: float, stated_mm: float, radius: float, fits: Alternatives
) -> list[str]:
    """A doubt if the LEDs are not where the sensor's drawing has them, with what would agree."""
    if abs(fitted_mm / stated_mm - 1) < DISTANCE_TOLERANCE:
        return []
    contradiction = (
        f"the LEDs are found {fitted_mm:.4g} mm from the film's middle, not {stated_mm:.4g} mm: "
    )
    for name in (OTHER_SIZE, CLEAR_GEL):
        other = fits.by_name[name]
        if _is_other(fits, name) and abs(other.distance / stated_mm - 1) < DISTANCE_TOLERANCE:
            return [contradiction + f"`evidence.radius`={radius * other.size:.3g} would agree"]
    share = stated_mm / fitted_mm
    return [
        contradiction
        + f"the ball's radius and the pixel size would agree if both were {share:.3g} times as "
        f"large{RADIUS_INPUTS}; or `led_distance_mm` is wrong"
    ]
