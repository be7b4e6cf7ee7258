"""Judge by the light what was given of a ball and a camera: do other values explain it better?

A wrong radius gives the normals a wrong scale.  LEDs at other distances, a gain of touched film
or a gel that diffuses light can make up for that on the ball, but then the film at rest is not lit
as the flat frame shows it.  So a plain film is fitted to balls and flat frame together, once with
the values given, and once with each of them free: the radius, the pupil's height, the camera's
gamma.  Whichever leaves less is likelier, by odds that are those of the residuals' likelihoods.
A pixel size that is wrong by a factor is a radius that is wrong by its inverse.

Up to the third power of the slope, a ball that is too small looks like a gel that diffuses light.
So where the gel seems to diffuse some, a last fit has a free radius and a gel that diffuses none.
If the light does not exclude it, the radius given is not confirmed, and the heights' scale is as
uncertain as these two are apart.  What settles it is another clue to the gel or to the lengths: a
shadow of the ball on itself, which a gel that diffuses light brightens, or the LEDs' distance by a
ruler, if both radii place them apart.  A second ball settles nothing: wrong by the same factor, as
by a wrong pixel size, it looks right as well.

Long because every doubt says in words what may be wrong and what would agree.
"""

import math
from typing import Annotated, NamedTuple, Self

import numpy as np
from annotated_types import Gt
from scipy.special import chdtri

from tactograph.graph import InputError, node
from tactograph.nodes import FALSE_ALARMS, Film, Metrics, ScaleError
from tactograph.nodes.calibrate import MIN_FLAT_LIGHT
from tactograph.nodes.calibrate.ball.ball_surface import sunk
from tactograph.nodes.calibrate.ball.balls_on_film import Balls, Fitted
from tactograph.nodes.calibrate.film.ball_samples import FilmEvidence
from tactograph.nodes.calibrate.film.film_fit import Fitting
from tactograph.nodes.calibrate.film.film_unknowns import STATED_UNKNOWNS, USUAL_NEARNESS
from tactograph.nodes.calibrate.lights.light_fit import LedPlaces, slants_of
from tactograph.nodes.calibrate.rating.judge_labels import MAX_JUDGED_BALLS
from tactograph.nodes.calibrate.rating.verdict import MAX_INDEPENDENT_REST, SURE_ODDS

MAX_SAMPLES = 600
"""Samples of the balls; a radius that is worth a warning shows with few."""
FIRST_SIZES = (0.1, 0.5, 1.0, 2.0)
"""Radii from which a free one starts, over that given: units, radius and diameter are easily
confused."""
REFUSED_ODDS = SURE_ODDS**3
"""Odds from which nothing else is possible, as if three sure signs spoke for it."""
SAME_SIZE = 0.02
"""Relative difference up to which two radii count as equal."""
RULER_ERROR = 0.04
"""Relative standard error of the LEDs' distance by a ruler, and of that which one ball shows."""
ONLY_WARN_ADVICE = "; `only_warn`=true writes the calibration nevertheless, marked as doubtful"
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
FIRST_SIZES_OF = {OTHER_SIZE: FIRST_SIZES, CLEAR_GEL: FIRST_SIZES[1:]}
"""A gel that diffuses no light leaves a radius open, and never one in another unit."""


class Explained(NamedTuple):
    """What a plain film explains of the light where a value is free.

    The balls' radius over the given one, the power to which the camera raises the light, one over
    the pupil's height; the departure left on balls and flat frame, the LEDs' mean distance in mm,
    the mean share of light that the gel diffuses.
    """

    size: float
    power: float
    camera: float
    departure: float
    distance: float
    diffuse: float


class Alternatives(NamedTuple):
    """What each of `FREE_PARTS` explains, and how many independent values the light counts as.

    `cap` is how high the balls are if their radius is another, over their height if it is as given;
    `ruler_mm` the LEDs' mean distance by a ruler.
    """

    by_name: dict[str, Explained]
    values: float
    cap: dict[str, float]
    ruler_mm: float | None = None

    @classmethod
    def of(
        cls,
        evidence: FilmEvidence,
        balls: Balls,
        camera: float | None = 0.0,
        coated: bool = False,
        aimed: Film | None = None,
    ) -> Self:
        """Fit the plain film with the values given and with each of them free.

        Parameters
        ----------
        evidence, balls : what a film is fitted to, and samples of its balls
        camera
            One over the pupil's height above the film; 0: it is free.  None: the camera is far.
        coated : whether a film with a coat is tried, too, with the values given
        aimed : from whose LEDs fits start, as they need not face the middle; None: they do
        """
        rest, width, start = evidence.rest(), balls.width_mm, evidence.start()
        leds = start.leds.copy()
        leds[:, 2] = USUAL_NEARNESS / width
        film = start.film._replace(camera=camera or 0.0)
        if aimed is not None:
            leds[:, :3] = LedPlaces.of(aimed.lights).values
            film = film._replace(emission=aimed.emission, aim=aimed.aim)
        start = start._replace(film=film).with_leds(leds)
        samples = balls.thinned(MAX_SAMPLES)

        def fitted(parts: frozenset[str], start: Fitted) -> Fitted:
            return Fitting.of(samples, rest, {*parts, "aim"} if film.aim else parts).fitted(start)

        def explained(now: Fitted) -> Explained:
            flat = now.left_at_rest(rest)
            distance = float(np.linalg.norm(now.film.lights, axis=1).mean())
            values = now.size, now.power, now.film.camera, math.hypot(now.scale, flat), distance
            return Explained(*values, float(now.film.diffuse.mean()))

        def best(name: str) -> Explained:
            parts, sizes = FREE_PARTS[name], FIRST_SIZES_OF.get(name, (1.0,))
            starts, candidates = [start._replace(size=size) for size in sizes], []
            if OTHER_CAMERA in parts:
                near = start.film._replace(camera=USUAL_NEARNESS / width)
                starts.append(start._replace(film=near))
            for first in starts:
                now = fitted(parts, first)
                candidates.append(explained(now))
                # What a fit leaves of the flat frame counts as the flat frame's own error.  One
                # that leaves more there than on the balls may depart less from a matt film on.
                if candidates[-1].departure > math.sqrt(2) * now.scale:
                    candidates.append(explained(fitted(parts, fitted(frozenset(), first))))
            return min(candidates, key=lambda each: each.departure)

        without = {OTHER_CAMERA: camera != 0, WITH_COAT: not coated}
        by_name = {name: best(name) for name in FREE_PARTS if not without.get(name)}
        # A camera that is found far away is as given, and its fit may end in a lower minimum.
        if (far := by_name.get(OTHER_CAMERA)) is not None and far.camera == 0:
            by_name[AS_STATED] = min(by_name[AS_STATED], far, key=lambda each: each.departure)
        values = min(samples.light.size, MAX_INDEPENDENT_REST * len(start.leds))
        names = OTHER_SIZE, CLEAR_GEL
        cap = {name: _cap(balls, by_name[name].size) / _cap(balls, 1.0) for name in names}
        return cls(by_name, values, cap)

    @property
    def stated(self) -> Explained:
        """What a plain film explains with the values given."""
        return self.by_name[AS_STATED]

    def odds(self, name: str, over: float | None = None) -> float:
        """Return how much likelier an alternative is than what was given, or than a departure.

        The likelihood of n residuals of unknown spread goes as the spread to the power of -n.
        """
        over = self.stated.departure if over is None else over
        digits = self.values * math.log10(over / self.by_name[name].departure)
        return float(10.0 ** min(digits, 300.0))

    def is_excluded(self, name: str, ruler_mm: float | None = None) -> bool:
        """Return whether the LEDs' distance by a ruler is surely not that of an alternative."""
        ruler_mm = ruler_mm or self.ruler_mm or self.by_name[name].distance
        errors = (self.by_name[name].distance / ruler_mm - 1) / RULER_ERROR
        return errors**2 / 2 > math.log(SURE_ODDS)

    def doubts(self, radius: float, misfit: float = math.inf) -> tuple[list[str], bool]:
        """Return at most one doubt of what was given, and whether the light contradicts it.

        Parameters
        ----------
        radius : the radius given, in mm
        misfit : what the film chosen for the values given leaves of the light
        """
        likely = [
            name
            for name in (OTHER_SIZE, OTHER_CAMERA, OTHER_POWER)
            if self.is_other(name)
            and self.odds(name) > SURE_ODDS
            and self.odds(name, misfit) > 1 / SURE_ODDS
        ]
        if likely:
            likely.sort(key=lambda name: self.by_name[name].departure)
            odds = min(self.odds(likely[0]), self.odds(likely[0], misfit))
            return [self._contradiction(likely, radius)], odds > REFUSED_ODDS
        if misfit < math.inf and self.odds(AS_STATED, misfit) > REFUSED_ODDS:
            doubt = (
                f"no model of the film explains balls and untouched film together: the best leaves "
                f"{misfit:.1%} of the light unexplained, where a plain film leaves "
                f"{self.stated.departure:.1%}. Check the order of the images, the focus, the "
                f"ball's radius and the pixel size{RADIUS_INPUTS}; give the height of a near "
                "camera (`film.camera`=MM), and a lens that distorts"
            )
            return [doubt], False
        return [], False

    def _contradiction(self, likely: list[str], radius: float) -> str:
        """What explains the light better than what was given, the likeliest first, and the cure."""
        size, power = self.by_name[OTHER_SIZE].size, self.by_name[OTHER_POWER].power
        camera = self.by_name.get(OTHER_CAMERA)
        wrong = "too large" if size < 1 else "too small"
        unit, diameter, as_given, _ = FIRST_SIZES
        wrong = "its diameter" if size < math.sqrt(diameter * as_given) else wrong
        wrong = "in another unit" if size < math.sqrt(unit * diameter) else wrong
        near = ", or the camera near the film, whose height you have not given (`film.camera`=MM)"
        # Another value, that given, and the cure.
        words = {
            OTHER_SIZE: (
                f"a ball of {radius * size:.3g} mm radius",
                f"one of {radius:.3g} mm",
                f"is the radius given {wrong}, or the pixel size too "
                f"{'small' if size < 1 else 'large'}, as by another zoom"
                f"{near * (camera is not None)}? Measure radius and pixel size{RADIUS_INPUTS}",
            ),
            OTHER_POWER: (
                f"light that the camera raises to the power of {power:.3g}",
                "linear light",
                "the camera's values are not linear: switch its gamma and contrast off",
            ),
        }
        if camera is not None and camera.camera:
            words[OTHER_CAMERA] = (
                f"a camera {1 / camera.camera:.3g} mm above the film",
                "one far away",
                "give its height (`film.camera`=MM), or a lens",
            )
        best, *rest = likely
        other, as_stated, cure = words[best]
        least = self.by_name[best].departure
        alike = [words[name][0] for name in rest if self.odds(name, least) > 1 / REFUSED_ODDS]
        return (
            f"{other} explains the light better than {as_stated}, {_times(self.odds(best))} "
            f"likelier ({least:.1%} unexplained instead of {self.stated.departure:.1%})"
            + "".join(f"; so does {each}" for each in alike)
            + f": {cure}"
        )

    def unconfirmed(self, radius: float, misfit: float = math.inf, ruler: str = "") -> str:
        """Return what is open if a gel that diffuses no light is not excluded, with another radius.

        And what settles it: a shadow does; the LEDs' distance, the input `ruler`, where that with
        the radius given excludes all that is open.
        """
        open_ones, stated = self._open_ones(misfit), self.stated
        if not open_ones:
            return ""
        shares = {name: f"{self.by_name[name].diffuse:.0%}" for name in (AS_STATED, *open_ones)}
        # The radii differ in more than what the gel diffuses if that is the same.
        has_shares = len(set(shares.values())) > 1
        fits = f"{radius:.3g} mm fits"
        fits += f" if the gel diffuses {shares[AS_STATED]} of the light" * has_shares
        for name in open_ones:
            likelier = f", {_times(self.odds(name))} likelier" * (name == OTHER_SIZE)
            likelier += "," * bool(likelier and has_shares)
            fits += f", and so does {radius * self.by_name[name].size:.3g} mm{likelier}"
            fits += f" if it diffuses {shares[name]}" * has_shares
        advice = ""
        if ruler and all(self.is_excluded(name, stated.distance) for name in open_ones):
            apart = " or ".join(f"{self.by_name[n].distance:.3g}" for n in (AS_STATED, *open_ones))
            advice = f", or the LEDs' mean distance from the film's middle, {apart} mm ({ruler}=MM)"
        return (
            f"the light does not confirm the ball's radius: {fits}. Heights may be "
            f"{self.scale_error(misfit):.0%} off. What settles it: a deeper press, with the ball's "
            f"shadow on itself{advice}"
        )

    def scale_error(self, misfit: float = math.inf) -> float:
        """Return by what share the balls may be higher or lower than given; 0 if that is confirmed.

        Either the radius is another, or the pixel size is, by the inverse: then all heights change
        by that once more.  Neither is likelier, so the squares of both are averaged.
        """
        either = [
            (self.cap[name], self.cap[name] / self.by_name[name].size)
            for name in self._open_ones(misfit)
        ]
        return max((math.hypot(a - 1, b - 1) / math.sqrt(2) for a, b in either), default=0.0)

    def _open_ones(self, misfit: float) -> list[str]:
        """The alternatives with other radii that the light leaves open.

        A gel that diffuses none is the simplest, and open until it is excluded.  One that diffuses
        some explains anything that it does better by chance, and is open if it is half way to sure.
        """
        from_odds = {CLEAR_GEL: 1 / SURE_ODDS, OTHER_SIZE: math.sqrt(SURE_ODDS)}
        return [
            name
            for name, least in from_odds.items()
            if self.is_other(name)
            and self.odds(name) > least
            and self.odds(name, misfit) > 1 / SURE_ODDS
            and not self.is_excluded(name)
        ]

    def is_other(self, name: str) -> bool:
        """Return whether an alternative is there, and has another value than the given one."""
        each, camera = self.by_name.get(name), self.stated.camera
        return each is not None and (
            max(abs(each.size - 1), abs(each.power - 1)) > SAME_SIZE or each.camera != camera
        )


class JudgedRadius(NamedTuple):
    """A `Judged`, and the relative error of the heights' scale that the light leaves open."""

    quality: Metrics
    doubts: list[str]
    unconfirmed: str
    scale_error: ScaleError


@node
def judge_radius(
    evidence: FilmEvidence,
    film: Film | None = None,
    fitted: Metrics | None = None,
    of_pixels: list[str] | None = None,
    other_doubts: list[str] | None = None,
    rest_error: ScaleError | None = None,
    *,
    led_distance_mm: Annotated[float, Gt(0)] | None = None,
    only_warn: bool = False,
) -> JudgedRadius:
    """Fit a plain film with other values than those given; doubt these if others are likelier.

    Parameters
    ----------
    evidence : the inputs of `fit_film`
    film, fitted
        The film that `fit_film` found with the values given, and its figures.  They are doubted
        only if this film is not surely likelier than the plain one with other values.  None: no
        film is fitted, the LEDs' places are not known, and the camera is far.
    of_pixels
        Doubts of the pixels' sides.  They may be the cause, so that the radius is not refused.
    other_doubts
        Doubts of images, flat frame and the film's shape; named in place of the radius, which they
        spoil.
    rest_error
        Relative error of the heights by a film at rest that is not well known; a plane is.
    led_distance_mm
        Mean distance of the LEDs from the middle of the film, by a ruler or a drawing of the
        sensor.
    only_warn : whether a radius that the light contradicts is doubted instead of refused

    Returns
    -------
    The figures of `fit_film`; ``light_departure_percent``, what a plain film with the values given
    leaves of the balls' light and of the flat frame; ``light_radius_mm``, the radius of the first
    ball that explains the light best, where a plain film does; ``scale_error_percent``.  One doubt
    if other values are likelier, or if the light does not confirm the radius, and one if the LEDs
    are found at another distance than given.  Without a film: ``diffuse_percent``, what the gel
    seems to diffuse; ``matt``, 1 where a plain film explains the light but for noise, by a
    chi-squared test at `FALSE_ALARMS`; ``scale_error_percent``; at most one doubt.

    Raises
    ------
    InputError
        If the light contradicts the values given and `only_warn` is not set.
    """
    if film is None or fitted is None:
        return _of_plain_films(evidence.used(MAX_JUDGED_BALLS))
    used = evidence.used()
    balls = used.sample(Film.matt(evidence.first_lights), most=None, fine=True)
    first = float(used.radius[0])
    misfit = fitted["film_residual_percent"], fitted.get("flat_residual_percent", 0.0)
    percent = float(np.hypot(*misfit)) / 100
    # On a film that is no plane, the pupil is where its shape was seen from.
    camera = film.camera if evidence.shape is None else film.camera or None
    fits = Alternatives.of(used, balls, camera, aimed=film if film.aim else None)
    departure = fits.stated.departure
    # As it is given, the LEDs are where the film that is kept has them.
    mean = float(np.linalg.norm(film.lights, axis=1).mean())
    fits.by_name[AS_STATED] = fits.stated._replace(distance=mean)
    fits = fits._replace(ruler_mm=led_distance_mm)
    doubts, is_clear = fits.doubts(first, percent)
    if is_clear and not (only_warn or of_pixels):
        raise InputError([*(other_doubts or []), *doubts][0] + ONLY_WARN_ADVICE)
    doubts += _of_distance(fits, first)
    is_open = "" if doubts else fits.unconfirmed(first, percent, "`led_distance_mm`")
    # The small balls of a grid throw no shadow, however deep they are pressed.
    doubts += [is_open] * bool(is_open and np.bincount(used.of).max() == 1)
    scale = math.hypot(fits.scale_error(percent), rest_error or 0.0)
    quality = fitted | {
        "light_departure_percent": 100 * departure,
        "scale_error_percent": 100 * scale,
    }
    if fits.odds(OTHER_SIZE, percent) > 1 / SURE_ODDS:
        likelier = fits.is_other(OTHER_SIZE) and fits.odds(OTHER_SIZE) > SURE_ODDS
        quality["light_radius_mm"] = first * (fits.by_name[OTHER_SIZE].size if likelier else 1)
    return JudgedRadius(quality, doubts, is_open, scale)


def _of_plain_films(evidence: FilmEvidence) -> JudgedRadius:
    # A matt film throws no light on itself, wherever its lights are.
    balls = evidence.sample(Film.matt(evidence.first_lights), most=None, fine=True)
    normal, *_ = balls.surface(np.zeros((len(balls.centre), 3)), 0.0)
    lit = balls.light > MIN_FLAT_LIGHT
    slants = [slants_of(normal[:, of], k[of]) for k, of in zip(balls.light, lit, strict=True)]
    lights = np.array([[*slant, 1.0] for slant in slants], np.float32)
    fits = Alternatives.of(evidence._replace(first_lights=lights), balls, None, coated=True)
    radius, stated, scale = float(evidence.radius[0]), fits.stated, fits.scale_error()
    # What a coat explains better is no evidence of another radius or of a gamma.
    doubts, _ = fits.doubts(radius, min(stated.departure, fits.by_name[WITH_COAT].departure))
    quality = {"diffuse_percent": 100 * stated.diffuse, "scale_error_percent": 100 * scale}
    noise = evidence.noise[1] / np.median(balls.reference_light) ** 2
    if stated.departure**2 <= chdtri(fits.values, FALSE_ALARMS) / fits.values * noise:
        quality["matt"] = 1.0
    return JudgedRadius(quality, doubts, "" if doubts else fits.unconfirmed(radius), scale)


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


def _of_distance(fits: Alternatives, radius: float) -> list[str]:
    """A doubt if the LEDs are not where a ruler has them, with what would agree."""
    if fits.ruler_mm is None or not fits.is_excluded(AS_STATED):
        return []
    mean = fits.stated.distance
    share = fits.ruler_mm / mean
    agree = (
        f"the ball's radius and the pixel size would agree if both were {share:.3g} times as large"
        f"{RADIUS_INPUTS}; or `led_distance_mm` is wrong"
    )
    for name in (CLEAR_GEL, OTHER_SIZE):
        if fits.is_other(name) and not fits.is_excluded(name):
            agree = f"`evidence.radius`={radius * fits.by_name[name].size:.3g} would agree"
    return [
        f"the LEDs are found {mean:.4g} mm from the film's middle, not {fits.ruler_mm:.4g} mm: "
        + agree
    ]
