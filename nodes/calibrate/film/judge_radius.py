"""Judge the ball's radius by the light: does another one explain the presses better?

A wrong radius gives the normals a wrong scale.  LEDs at other distances, a gain of touched film
or a coat can make up for that on the ball, but then the film at rest is not lit as the flat frame
shows it.  So a plain model is fitted with other radii, and balls and flat frame are judged
together.  Where the gel diffuses light, a radius that is too large looks like a gel that diffuses
none; one that is too small, where no shadow falls on the ball, like a gel that diffuses some.  A
pixel size that is wrong by a factor is a radius that is wrong by its inverse.  A camera's gamma
bends the light otherwise than any radius.

Long because every doubt says in words what may be wrong and what would agree.
"""

from collections.abc import Iterable
from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt

from tactograph.graph import InputError, node
from tactograph.nodes import F4, F8, Film, Metrics
from tactograph.nodes.calibrate import SHIFT_DEVIATION_PX
from tactograph.nodes.calibrate.film._ball_samples import lights_itself, sample_balls, thinned
from tactograph.nodes.calibrate.film._film_at_rest import rest_left
from tactograph.nodes.calibrate.film._light_pattern import light_pattern
from tactograph.nodes.calibrate.film.balls_on_film import Balls, Fitted
from tactograph.nodes.calibrate.film.film_fit import fit, start_at
from tactograph.nodes.calibrate.film.fit_film import FilmEvidence
from tactograph.nodes.calibrate.lights.light_samples import Rest, rest_of
from tactograph.nodes.calibrate.rating.verdict import Judged
from tactograph.nodes.optics.film import matt_film
from tactograph.nodes.optics.rest_shape import RestShape

RADIUS_FACTORS = (0.5, 0.6, 0.7, 0.78, 0.86, 0.93, 1.0, 1.07, 1.16, 1.28, 1.45, 1.7, 2.0)
"""First trial radii, relative to the given one; finer ones follow between the best two."""
FINER_SHARES, FINER_ROUNDS = (0.35, 0.7), 2
"""Places between the best radius and its neighbours that are tried then, and how often."""
MAX_SAMPLES = 600
"""Samples of the balls; a radius that is worth a warning shows with few."""
PLAIN_PARTS = frozenset({"plain"})
"""Parts of the plain model: a lobe, or light from film to film, can hide a wrong radius."""
USUAL_NEARNESS = 0.2
"""Widths of the image over the distance of an LED from which each fit starts."""
BELIEVED_BELOW, REFUSED_BELOW = 0.6, 0.3
"""Departure, relative to that with the given radius, below which another radius is preferred, and
below which the given one is refused."""
PLAIN_RATIO = 1.02
"""Departure of a plain film, relative to that of the film chosen, up to which it is as good."""
FORCE_ADVICE = "; `force`=true writes the calibration nevertheless, marked as doubtful"
RADIUS_INPUTS = " (`evidence.radius`, `evidence.pixel`)"
CAMERA_ADVICE = "; if the camera is near the film, give its height (`film.camera`=MM)"
SMALLER_FACTOR, EQUAL_DEPARTURE = 0.75, 1.1
"""Factor below which a radius counts as another one where the light cannot tell them apart, and the
ratio of what they leave on the balls up to which it cannot."""
MIN_DIFFUSE, GEL_DIFFUSE = 0.05, (0.2, 0.65)
"""Share of diffused light below which a gel has none, and the range of real gels: a radius too
large by a third or more takes it for curvature.  0.3 to 0.5 on two real sensors."""
MIN_DIFFUSE_SHARE, SHADOW_SHARE, SHADOW_MARGIN = 0.03, 0.04, 0.02
"""Share of diffused light that a radius or pixel size wrong by 2 % looks like; the share of the
light that has to lie within a margin above it for a shadow that measures it."""
MOST_OF_PLAIN_GELS = 0.3
"""Share from which on one-shot sensors' clear gels begin, whose presses are too shallow to throw
shadows."""
DARKEST_QUANTILE, MAX_DARKENING = 0.005, 0.88
"""Quantile of the light that the gel's diffused share may exceed at most by the inverse of this."""
GAMMA_EXPONENTS = (1 / 1.5, 1 / 1.15, 1.15, 1.5)
"""Powers of the light that may undo a camera's gamma."""
MIN_PATTERN, MAX_PATTERN_RATIO = 0.005, 0.7
"""Departure of the light's means up to which film is plain, and the ratio of two such departures
below which the smaller one is believed."""
RADIUS_TOLERANCE = 0.02
"""Relative difference up to which two radii count as equal."""
GIVEN_UP_RATIO = np.sqrt(2)
"""Departure over that on the balls, above which most of the residual is in the flat frame."""
DISTANCE_TOLERANCE = 0.15
"""Tolerated relative difference between the LEDs' distance as found and as given."""


class Tried(NamedTuple):
    """A radius, relative to the given one, and the fit of a plain film with it.

    The departure left on balls and flat frame, that on the balls alone, the LEDs' mean distance
    in mm, the mean share of light that the gel diffuses, and the departure of balls and flat frame
    with the camera's noise averaged out (`light_pattern`).
    """

    factor: float
    departure: float
    on_balls: float
    distance: float
    diffuse: float
    pattern: float = 0.0


class Doubt(NamedTuple):
    """A sentence against a radius, empty if there is none; whether the light contradicts it."""

    sentence: str
    is_clear: bool


@node
def judge_radius(
    evidence: FilmEvidence,
    film: Film,
    fitted: Metrics,
    *,
    led_distance_mm: Annotated[float, Gt(0)] | None = None,
    force: bool = False,
) -> Judged:
    """Fit a plain film with other radii; doubt the given one if another explains the light better.

    Parameters
    ----------
    evidence : the inputs of `fit_film`
    film, fitted
        The film that `fit_film` found with the given radius, and its figures.  A radius is
        doubted only if the plain model with another one departs less than this film.
    led_distance_mm
        Mean distance of the LEDs from the middle of the film, where a drawing of the sensor
        gives it.
    force : whether a radius that the light contradicts is doubted instead of refused

    Returns
    -------
    The figures of `fit_film`; ``light_departure_percent``, what the plain model with the given
    radius leaves of the balls' light and of the flat frame; ``light_radius_mm``, the radius of the
    first ball that explains the light best, where a plain film does.  One doubt if another radius
    explains the light better, or as well with a gel as real ones are, and one if the LEDs are found
    at another distance than given.

    Raises
    ------
    InputError
        If the light contradicts the radius and `force` is not set.
    """
    light, flat, circle, radius, of, kept, lights, strength, noise, pixel, shape = evidence
    used = np.flatnonzero((kept[of] > 0) & (circle[:, 2] > 0))
    balls = sample_balls(
        *(light, flat, circle[used], radius[used], of[used], matt_film(lights), noise, pixel),
        most=None,
        fine=True,
        shape=shape,
    )
    first, left = float(radius[used[0]]), _left(fitted)
    # A distance that is given is compared with that of every radius.
    enough = left if led_distance_mm is None else np.inf
    trials = try_radii(balls, flat, pixel, lights, strength, left=enough, shape=shape)
    given, doubt = as_given(trials), doubt_of_radius(trials, first, left, RADIUS_INPUTS)
    if doubt.sentence and not film.camera:
        doubt = doubt._replace(sentence=doubt.sentence + CAMERA_ADVICE)
    doubts = [doubt.sentence] if doubt.sentence else []
    if doubt.is_clear and not force:
        raise InputError(doubt.sentence + FORCE_ADVICE)
    if not doubts and not lights_itself(film) and given.pattern >= MIN_PATTERN:
        gammas = try_gammas(balls, flat, pixel, lights, strength, shape)
        doubts += doubt_of_pattern(trials, gammas, first, RADIUS_INPUTS)
    if led_distance_mm is not None:
        mean = float(np.linalg.norm(film.lights, axis=1).mean())
        doubts += _of_distance(mean, led_distance_mm, first, trials)
    elif not doubts:
        # Where a plain film leaves noise alone, further parts only hide what it would diffuse.
        is_plain = _is_noise(given, left)
        diffuse = given.diffuse if is_plain else float(film.diffuse.mean())
        advice = RADIUS_INPUTS, ", or give `led_distance_mm`=MM"
        # A grid's pitch confirms the pixel.
        most = MOST_OF_PLAIN_GELS if np.bincount(of[used]).max() > 1 else 1.0
        doubts += doubt_of_diffuse(diffuse, balls.light, first, *advice, most=most)
    quality = fitted | {"light_departure_percent": 100 * given.departure}
    if (best := _best(trials)).departure < EQUAL_DEPARTURE * left:
        quality["light_radius_mm"] = first * best.factor
    return Judged(quality, doubts)


def try_radii(
    balls: Balls,
    flat: F4,
    pixel: float,
    lights: F4,
    strength: F4,
    factors: tuple[float, ...] = RADIUS_FACTORS,
    rounds: int = FINER_ROUNDS,
    left: float = np.inf,
    shape: RestShape | None = None,
) -> list[Tried]:
    """Fit the plain film to balls of other radii, by `factors`, and near the best one.

    Where the residual of the given radius is mostly noise, and that of the film chosen is `left`,
    no other can be preferred: only those that may explain the light as well are tried.
    """
    rest, width = rest_of(flat, pixel, shape), pixel * flat.shape[2]
    start = _start(lights, strength, len(balls.centre), width)
    deepest = min(float((balls.rim / balls.radius).max()), 1.0)

    def tried(factors: Iterable[float]) -> list[Tried]:
        return [_try(balls, rest, start, f, pixel, width) for f in factors]

    trials = tried([1.0])
    if _is_noise(trials[0], left):
        factors, rounds = tuple(f for f in factors if f < SMALLER_FACTOR), 0
    others = {deepest, *(factor for factor in factors if factor > deepest)}
    trials = sorted(trials + tried(f for f in others if abs(f - 1) > RADIUS_TOLERANCE))
    for _ in range(rounds):
        trials = sorted(trials + tried(_beside(_best(trials), trials)))
    return trials


def try_gammas(
    balls: Balls,
    flat: F4,
    pixel: float,
    lights: F4,
    strength: F4,
    shape: RestShape | None = None,
) -> dict[float, float]:
    """Return a plain film's residuals for light raised to powers, by power (`light_pattern`)."""
    rest, width = rest_of(flat, pixel, shape), pixel * flat.shape[2]
    left = {}
    for power in GAMMA_EXPONENTS:
        start = _start(lights, strength**power, len(balls.centre), width)
        linear = replace(balls, light=np.maximum(balls.light, 0) ** power)
        even = None if rest is None else replace(rest, logarithm=rest.logarithm * power)
        left[power] = _try(linear, even, start, 1.0, pixel, width).pattern / power
    return left


def _is_noise(given: Tried, left: float) -> bool:
    """Whether noise hides any difference between the given radius and a better one."""
    noise = np.sqrt(max(given.departure**2 - given.pattern**2, 0))
    return given.pattern < MIN_PATTERN and BELIEVED_BELOW * max(given.departure, left) < noise


def doubt_of_pattern(
    tried: list[Tried], gammas: dict[float, float], radius: float, which: str = ""
) -> list[str]:
    """Return a doubt if another radius, or linear light, leaves no pattern where this one does.

    `which` names, in brackets, where radius and pixel size are given.
    """
    given = as_given(tried).pattern
    best, power = min(tried, key=lambda each: each.pattern), min(gammas, key=gammas.__getitem__)
    least = min(best.pattern, gammas[power])
    if given < MIN_PATTERN or least > MAX_PATTERN_RATIO * given:
        return []
    shown = f"the balls' light departs by {given:.2%} from that of a plain film, noise apart, but "
    if gammas[power] < MAX_PATTERN_RATIO * best.pattern:
        return [
            "the camera's values are not linear: switch its gamma and contrast off ("
            f"{shown}by {least:.2%} where values are raised to the power of {power:.3g})"
        ]
    if abs(best.factor - 1) < RADIUS_TOLERANCE:
        return []
    return [
        f"the ball's radius or the pixel size{which} is wrong, or the camera's gamma is on: {shown}"
        f"by {best.pattern:.2%} with a ball of {radius * best.factor:.3g} mm radius, and by "
        f"{gammas[power]:.2%} where values are raised to the power of {power:.3g}"
    ]


def doubt_of_diffuse(
    diffuse: float,
    light: F8,
    radius: float,
    which: str = "",
    advice: str = "",
    most: float = MOST_OF_PLAIN_GELS,
) -> list[str]:
    """Return a doubt if light that the gel seems to diffuse may be a wrong radius or pixel size.

    Up to the third power of the slope, a ball that is too small looks like a gel that diffuses
    light.  Only a shadow on the ball, which is as bright as the diffused light, tells them apart.
    """
    darkest = float(np.quantile(light, DARKEST_QUANTILE))
    is_shaded = float((light < diffuse + SHADOW_MARGIN).mean()) > SHADOW_SHARE
    is_too_dark = darkest < MAX_DARKENING * diffuse
    if diffuse < MIN_DIFFUSE_SHARE or not (is_too_dark or (diffuse < most and not is_shaded)):
        return []
    without = radius / np.sqrt(1 - diffuse)
    return [
        f"the light does not confirm the ball's radius: {radius:.3g} mm fits if the gel diffuses "
        f"{diffuse:.0%} of the light, {without:.3g} mm if it diffuses none. Measure the ball and "
        f"the pixel size{which}, or press deeper, until the ball throws a shadow on itself{advice}"
    ]


def doubt_of_radius(
    tried: list[Tried], radius: float, left: float = np.inf, which: str = ""
) -> Doubt:
    """Return the evidence of the light against a radius; none if it is right.

    Parameters
    ----------
    tried : as `try_radii` returns it
    radius : the radius given, in mm
    left : what the film chosen for that radius leaves of the light
    which : in brackets, where radius and pixel size are given
    """
    best, given = _best(tried), as_given(tried)
    # On ties, prefer the simpler film.
    is_other = abs(best.factor - 1) > RADIUS_TOLERANCE and best.departure < PLAIN_RATIO * left
    if is_other and best.departure < BELIEVED_BELOW * given.departure:
        return Doubt(
            f"a ball of {radius * best.factor:.3g} mm radius explains the light better than one of "
            f"{radius:.3g} mm ({best.departure:.1%} unexplained instead of {given.departure:.1%}): "
            f"is the radius given {_how_wrong(best.factor)}, or the "
            f"pixel size too {'small' if best.factor < 1 else 'large'}? Measure both{which}",
            best.departure < min(REFUSED_BELOW * given.departure, BELIEVED_BELOW * left),
        )
    if best.departure < BELIEVED_BELOW * left < np.inf:
        return Doubt(
            f"no model of the film explains balls and untouched film together: the best leaves "
            f"{left:.1%} of the light unexplained, where a plain film with a ball of "
            f"{radius * best.factor:.3g} mm radius leaves {best.departure:.1%}. Check the order of "
            f"the images, the ball's radius and the pixel size{which}",
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
            f"the radius given may be the ball's diameter, or the pixel size wrong: with "
            f"{radius:.3g} mm the gel would diffuse no light, with {radius * usual.factor:.2g} mm "
            f"{usual.diffuse:.0%}, as gels do. Measure both{which}",
            False,
        )
    return Doubt("", False)


def _how_wrong(factor: float) -> str:
    """What a radius may be, if another one is right by a factor."""
    if factor < SMALLER_FACTOR:
        return "its diameter"
    return "too large" if factor < 1 else "too small"


def _left(fitted: Metrics) -> float:
    """The share of the balls' light and of the flat frame that `fit_film` leaves."""
    left = fitted["film_residual_percent"], fitted.get("flat_residual_percent", 0.0)
    return float(np.hypot(*left)) / 100


def _try(
    balls: Balls, rest: Rest | None, start: Fitted, factor: float, pixel: float, width_mm: float
) -> Tried:
    """Fit the plain film to balls of other radii and the same contacts.

    A fit that leaves more of the flat frame than of the balls has given the flat frame up, since
    what it leaves there counts as the flat frame's own error.  Then one that begins with a matt
    film may depart less.
    """
    radius = balls.radius * factor
    other = replace(balls, radius=radius, rim=np.minimum(balls.rim, radius))
    samples = thinned(other, MAX_SAMPLES)

    def fitted(start: Fitted, parts: frozenset[str]) -> Fitted:
        return fit(samples, rest, parts, start, SHIFT_DEVIATION_PX * pixel, width_mm)

    def tried(start: Fitted) -> Tried:
        found = fitted(start, PLAIN_PARTS)
        flat = 0.0 if rest is None else float(np.sqrt(np.square(rest_left(rest, found)).mean()))
        departure = float(np.hypot(found.scale, flat))
        distance = float(np.linalg.norm(found.film.lights, axis=1).mean())
        pattern = float(np.hypot(light_pattern(other, found), flat))
        diffuse = float(found.film.diffuse.mean())
        return Tried(factor, departure, found.scale, distance, diffuse, pattern)

    first = tried(start)
    if first.departure < GIVEN_UP_RATIO * first.on_balls:
        return first
    return _best([first, tried(fitted(start, frozenset()))])


def _start(lights: F4, strength: F4, count: int, width_mm: float) -> Fitted:
    """A matt film under the LEDs, all equally near."""
    start = start_at(lights, strength, count)
    leds = start.leds.copy()
    leds[:, 2] = USUAL_NEARNESS / width_mm
    return start.with_leds(leds)


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
        return [contradiction + f"`evidence.radius`={radius * best.factor:.3g} would agree"]
    share = given_mm / found_mm
    return [
        contradiction
        + f"the ball's radius and the pixel size would agree if both were {share:.3g} times as "
        f"large{RADIUS_INPUTS}; or `led_distance_mm` is wrong"
    ]
