"""Fit a film's model of light and slope, as complex as its presses support.

The model grows part by part, then by harmonics, each judged on held-out balls.  Long because
each part of the film is one short step of the same search.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from tactograph.graph import Port, SizeLimit, node, warn
from tactograph.nodes import (
    F4,
    Film,
    Light,
    LightPlaces,
    LightPositions,
    Metrics,
    Misfit,
    Noise,
    PixelSize,
)
from tactograph.nodes.calibrate import FOLDS, BallCircles, BallPress, BallRadii
from tactograph.nodes.calibrate.film._ball_normals import normal_error
from tactograph.nodes.calibrate.film._ball_samples import grain, moved_with, sample_balls, thinned
from tactograph.nodes.calibrate.film._film_at_rest import rest_left
from tactograph.nodes.calibrate.film._film_misfit import Held, misfit, unevenness
from tactograph.nodes.calibrate.film._film_unknowns import PARTS
from tactograph.nodes.calibrate.film.balls_on_film import F8, Balls, Fitted, predicted
from tactograph.nodes.calibrate.film.film_fit import (
    add_harmonics,
    fit,
    other_places,
    place_balls,
    start_at,
)
from tactograph.nodes.calibrate.lights.light_fit import Rest, rest_of
from tactograph.nodes.light.film_bounce import CELLS
from tactograph.nodes.optics.film import FilmPart, matt_film
from tactograph.nodes.optics.radiosity import cell_grid
from tactograph.nodes.optics.sheet import SheetLight, SheetMask

FINAL_SAMPLES = 15000
"""Samples of the last fit, ten times as many as for the choice of parts.  With fewer, noise leaves
a ball's height, the coat's index and the albedo uncertain by some per cent."""
PART_ERROR_RATIO, HARMONICS_ERROR_RATIO, SINGLE_BALL_ERROR_RATIO = 0.97, 0.99, 0.7
"""Factor by which the held-out error must fall: for a part of the model; for harmonics; and for
either with a single ball, whose held-out slices lie between those that are fitted..."""
MIN_GAIN_DEG = 0.02
"""... and the number of degrees by which it must fall."""
MAX_ROUNDS, MAX_CHANGE = 4, 0.004
"""Most rounds that find the balls' positions and the light from film to film in turn, and the
relative change of albedo and contact radius below which they end."""
MIN_BALLS_TO_REJECT, MAX_RESIDUAL_RATIO = 8, 2.0
"""With at least this many balls, those with a residual above this multiple of the median are left
out."""
GOOD_ERROR_DEG = 0.1
"""Degrees of held-out error below which no further part is tried."""
MIN_CAP_SHARE = 0.02
"""Height of a ball's cap, relative to the film's width, from which it shows the pupil's height."""
MIN_CONTACT_CELLS = 4
"""Contact radius in cells from which `film_bounce` resolves how a ball lights the film beside it.
On coarser cells its albedo would absorb residuals of other parts of the model."""
MIN_BALLS_BY_DEGREE = {0: 2, 1: 4, 2: 10}
"""Fewest balls for harmonics, by their degree in position."""


class FilmEvidence(NamedTuple):
    """Inputs of a fit: presses, film at rest, and the LEDs as placed for a matt film."""

    light: SheetLight
    flat: Light
    circle: BallCircles
    radius: BallRadii
    of: BallPress
    kept: Annotated[NDArray[np.uint8], Port("P", "flag", high=1)]
    first_lights: LightPositions
    strength: Annotated[F4, Port("K", "1")]
    noise: Noise
    pixel: PixelSize


class FilmFit(NamedTuple):
    """LEDs, film and camera, how well the model fits the presses, and what it was fitted to."""

    film: Film
    misfit: Misfit
    residual: Annotated[F4, Port("K", "1")]
    quality: Metrics
    evidence: FilmEvidence


@node(sizes={"K": SizeLimit(3, 8, "two LEDs leave two slopes, a label has 8 bits")})
def fit_film(
    light: SheetLight,
    flat: Light,
    circle: BallCircles,
    radius: BallRadii,
    of: BallPress,
    kept: Annotated[NDArray[np.uint8], Port("P", "flag", high=1)],
    lights: LightPositions,
    strength: Annotated[F4, Port("K", "1")],
    others: LightPlaces,
    noise: Noise,
    pixel: PixelSize,
    bare: SheetMask | None = None,
    *,
    camera_mm: Annotated[float, Gt(0)] | None = None,
    steepest: Annotated[float, Gt(0)] = 3.0,
    shift_px: Annotated[float, Gt(0)] = 0.5,
    without: tuple[FilmPart, ...] = (),
) -> FilmFit:
    """Fit equation F1 (`optics/film`) to balls, with those of its parts that the presses support.

    The fit starts from the LEDs placed for a matt film.  Then parts are added one by one:
    diffuse light with a gain of touched film, a glossy coat, light that bounces from film to
    film, a pupil near the film.  Each time, the part that explains the presses best is taken if
    it lowers the error of held-out balls by 3 per cent.  Harmonics come last, of the highest
    degree in position that lowers the error further.  With a single ball, slices of it are held
    out instead, and a part must lower their error by 30 per cent.

    Parameters
    ----------
    light
        K x S x W, the presses relative to the film at rest, on a sheet (`sheet`).
    flat
        K x H x W, the film at rest; uniform where there was none.
    circle, radius, of
        B x 3 in px, B in mm, and the press that each ball is in.
    kept
        1 for each of the P presses that is used.
    lights, strength, others
        K x 3 in mm, K and 8 x K x 3 in mm, as `calibrate_lights` returns them.
    noise
        (shot, read), as `estimate_noise` returns it.
    pixel
        mm per px.
    bare
        S x W on the sheet, 0 where a marker covers the film: such pixels are left out.
    camera_mm
        Height of the pupil above the film, if known.
    steepest, shift_px
        As for `calibrate_lights`.
    without
        Parts that are not tried: ``diffuse``, ``lobe``, ``bounce``, ``camera``, ``harmonics``.

    Returns
    -------
    FilmFit
        The `Film`, with LED positions sampled from the uncertainty of the fit; its errors on
        held-out samples, as a `Misfit`; the root mean square residual of each LED's light, K;
        the figures: ``film_heldout_deg/...`` for each model tried and ``film_heldout_deg`` of
        the one chosen, in degrees between normals; and the inputs, for `judge_radius`.
    """
    evidence = FilmEvidence(light, flat, circle, radius, of, kept, lights, strength, noise, pixel)
    used = np.flatnonzero((kept[of] > 0) & (circle[:, 2] > 0))
    circle, radius, of = circle[used], radius[used], of[used]

    def samples(
        film: Film,
        shifts: F8 | None = None,
        rim: F8 | None = None,
        **options: Any,
    ) -> Balls:
        given = light, flat, circle, radius, of, film, noise, pixel, steepest
        return sample_balls(*given, bare=bare, shifts=shifts, rim=rim, **options)

    balls = samples(matt_film(lights))
    width = pixel * flat.shape[2]
    trial = _Trial(balls, rest_of(flat, pixel), shift_px * pixel, width, samples)
    start = start_at(lights, strength, len(balls.centre))
    if camera_mm is not None:
        start = start._replace(film=start.film._replace(camera=1 / camera_mm))
    tall = balls.radius - np.sqrt(np.maximum(balls.radius**2 - balls.rim**2, 0))
    closed: set[str] = set(without)
    if camera_mm is not None or len(tall) < 2 or tall.max() < MIN_CAP_SHARE * width:
        closed.add("camera")
    if (
        np.median(balls.rim)
        < MIN_CONTACT_CELLS * cell_grid(flat.shape[1:], pixel, CELLS, 0).factor * pixel
    ):
        closed.add("bounce")
    trial, best, errors = _grow(trial, start, [part for part in PARTS if part not in closed])
    trial, best, whole = _settle(trial, best)
    errors[f"film_heldout_deg/{best}"] = errors["film_heldout_deg"] = best.error
    if "harmonics" not in closed and errors["film_heldout_deg"] > GOOD_ERROR_DEG:
        best = _bend(trial, best, errors)
    best, balls, bad = _without_bad(trial, best)
    film = best.fitted.film
    if not best.parts and best.degree is None and camera_mm is None:
        # A plain matt film keeps the LED positions that were fitted to all pixels.
        film = film._replace(lights=lights)
    else:
        fit_of = balls, trial.rest, best.parts, best.fitted, trial.shift_mm, width
        others = other_places(*fit_of)
    left = balls.light - predicted(balls, best.fitted)
    typed: dict[str, Any] = {
        name: np.asarray(value, np.float32) if isinstance(value, np.ndarray) else float(value)
        for name, value in film._asdict().items()
    }
    held = _held_out(trial, best, whole, bad)
    typed["uneven"] = uneven = unevenness(held, pixel)
    typed["grain"] = grain(balls, left, flat, noise)
    typed["pressed_slope"] = pressed_slope(balls, steepest)
    typed["others"] = others
    return FilmFit(
        Film(**typed),
        misfit=misfit(held, np.asarray(others - film.lights, np.float64), pixel, uneven),
        residual=np.sqrt(np.square(left).mean(axis=1)).astype(np.float32),
        quality=errors | _properties(best, trial.rest),
        evidence=evidence,
    )


def pressed_slope(balls: Balls, steepest: float) -> float:
    """Return the steepest slope of balls within their contacts, up to the steepest of a sample."""
    sine = float((balls.rim / balls.radius).max())
    return min(sine / math.sqrt(1 - sine**2), steepest) if sine < 1 else steepest


class _Trial(NamedTuple):
    """The data that every model is fitted to and judged by."""

    balls: Balls
    rest: Rest | None
    shift_mm: float
    width_mm: float
    samples: Callable[..., Balls]
    """Samples the balls again with another film, shifts, contact radii and further options of
    `sample_balls`."""

    def fit(self, parts: frozenset[str], start: Fitted, balls: Balls | None = None) -> Fitted:
        """Fit a model to all samples, or to the given ones."""
        return fit(balls or self.balls, self.rest, parts, start, self.shift_mm, self.width_mm)

    def folds(self) -> list[NDArray[np.bool_]]:
        """The samples to hold out in turn: some of the balls, or slices of a single ball."""
        return [self.balls.held_by % FOLDS == fold for fold in self.fold_numbers()]

    def fold_numbers(self) -> NDArray[np.intp]:
        """The fold numbers that occur: ball, or slice, modulo `FOLDS`."""
        return np.unique(self.balls.held_by % FOLDS)


class _Model(NamedTuple):
    """A fitted model: its parts, the harmonics' degree, and its held-out error."""

    parts: frozenset[str]
    degree: int | None
    fitted: Fitted
    error: float
    folds: list[Fitted]
    """The fit without each fold, in the order of `_Trial.folds`."""

    def __str__(self) -> str:
        parts = [part for part in PARTS if part in self.parts] or ["matt"]
        return "+".join(parts + ([f"harmonics{self.degree}"] if self.degree is not None else []))


def _judge(
    trial: _Trial, parts: frozenset[str], fitted: Fitted, degree: int | None = None
) -> _Model:
    """Fit without each fold, and measure the error of the normals on that fold."""
    errors, folds, weights = [], [], []
    for held in trial.folds():
        train, test = trial.balls.only(~held), trial.balls.only(held)
        refitted = trial.fit(parts, fitted, train)
        if degree is not None:
            refitted = add_harmonics(train, refitted, degree, trial.width_mm / 2, trial.shift_mm)
        if len(trial.balls.centre) > 1:
            refitted = place_balls(test, refitted, trial.shift_mm)
        errors.append(normal_error(test, refitted))
        folds.append(refitted)
        weights.append(held.sum())
    return _Model(parts, degree, fitted, float(np.average(errors, weights=weights)), folds)


def _held_out(trial: _Trial, best: _Model, whole: Balls, bad: NDArray[np.bool_]) -> list[Held]:
    """Every pixel of each fold, without bad balls, with the film fitted to the other folds."""
    good = whole.only(~bad[whole.ball])
    numbers = trial.fold_numbers()
    held = [
        (good.only(good.held_by % FOLDS == number), found)
        for number, found in zip(numbers, best.folds, strict=True)
    ]
    return [Held(b, place_balls(b, f, trial.shift_mm)) for b, f in held if b.u.size]


def _grow(trial: _Trial, start: Fitted, parts: list[str]) -> tuple[_Trial, _Model, Metrics]:
    """Add parts to the model one by one, as long as that pays.

    Once the film has a coat or an albedo, the samples are renewed: then the light that it
    reflects from film to film is known.
    """
    best = _judge(trial, frozenset(), trial.fit(frozenset(), start))
    errors = {f"film_heldout_deg/{best}": best.error}
    while best.error > GOOD_ERROR_DEG and (
        left := [part for part in parts if part not in best.parts]
    ):
        wider = [best.parts | {part} for part in left]
        fitted = [trial.fit(parts, best.fitted) for parts in wider]
        # Only the part that explains the presses best is judged on held-out samples.
        first = int(np.argmin([normal_error(trial.balls, found) for found in fitted]))
        better = _judge(trial, wider[first], fitted[first])
        errors[f"film_heldout_deg/{better}"] = better.error
        if not _pays(better.error, best.error, trial):
            break
        best = better
        if _lights_itself(best.fitted.film):
            trial, placed = _sampled_again(trial, best.fitted)
            best = best._replace(fitted=trial.fit(best.parts, placed))
            best = _judge(trial, best.parts, best.fitted)
            errors[f"film_heldout_deg/{best}"] = best.error
    return trial, best, errors | {"film_heldout_deg": best.error}


def _sampled_again(trial: _Trial, fitted: Fitted, **options: Any) -> tuple[_Trial, Fitted]:
    """Sample again with a better-known film, up to where it leaves the balls."""
    before, film = trial.balls, fitted.film
    edges = _lights_itself(film)
    balls = trial.samples(film, fitted.shifts, before.rim, edges=edges, **options)
    shifts = moved_with(fitted.shifts, balls.radius, before.rim, balls.rim)
    return trial._replace(balls=balls), fitted._replace(shifts=shifts)


def _lights_itself(film: Film) -> bool:
    """Whether the film shows light reflected from other parts of the film."""
    return film.refraction > 1 or film.albedo > 0


def _settle(trial: _Trial, best: _Model) -> tuple[_Trial, _Model, Balls]:
    """Fit the chosen parts to more samples until the light from film to film converges.

    Also returns every pixel of the balls.
    """
    for _ in range(MAX_ROUNDS):
        film, rim = best.fitted.film, trial.balls.rim
        trial, placed = _sampled_again(trial, best.fitted, most=None, fine=True)
        whole = trial.balls
        trial = trial._replace(balls=thinned(whole, FINAL_SAMPLES))
        best = best._replace(fitted=trial.fit(best.parts, placed))
        moved = np.abs(whole.rim / rim - 1).max()
        changed = abs(best.fitted.film.albedo - film.albedo)
        if film.albedo == 0 or (changed < MAX_CHANGE * film.albedo and moved < MAX_CHANGE):
            break
    return trial, _judge(trial, best.parts, best.fitted), whole


def _bend(trial: _Trial, best: _Model, errors: Metrics) -> _Model:
    """Add harmonics of the highest degree that pays."""
    physics = best
    for degree, fewest in MIN_BALLS_BY_DEGREE.items():
        if len(trial.balls.centre) < fewest:
            break
        tried = _judge(trial, physics.parts, physics.fitted, degree)
        errors[f"film_heldout_deg/{tried}"] = tried.error
        if _pays(tried.error, best.error, trial, HARMONICS_ERROR_RATIO):
            best = tried
    if best.degree is not None:
        bent = add_harmonics(
            trial.balls, best.fitted, best.degree, trial.width_mm / 2, trial.shift_mm
        )
        best = best._replace(fitted=bent)
    errors["film_heldout_deg"] = best.error
    return best


def _without_bad(trial: _Trial, best: _Model) -> tuple[_Model, Balls, NDArray[np.bool_]]:
    """Leave out outliers among many balls: scratched, dirty, or no balls.

    Also returns the samples of the others, and which balls are left out.
    """
    balls, count = trial.balls, len(trial.balls.centre)
    left = np.square(balls.light - predicted(balls, best.fitted)).mean(axis=0)
    by_ball = np.sqrt(np.bincount(balls.ball, left, count) / np.bincount(balls.ball))
    bad = by_ball > MAX_RESIDUAL_RATIO * np.median(by_ball)
    if count < MIN_BALLS_TO_REJECT or not bad.any():
        return best, balls, np.zeros(count, bool)
    x, y = balls.centre[bad].T
    where = ", ".join(f"({a:.2f}, {b:.2f})" for a, b in zip(x, y, strict=True))
    warn(f"{bad.sum()} of {count} balls depart from the others and are left out: at {where} mm")
    number = np.cumsum(~bad) - 1
    good = balls.only(~bad[balls.ball])
    good = replace(
        good,
        ball=number[good.ball],
        centre=balls.centre[~bad],
        rim=balls.rim[~bad],
        radius=balls.radius[~bad],
    )
    start = best.fitted._replace(
        shifts=best.fitted.shifts[~bad],
        film=best.fitted.film._replace(harmonics=np.zeros_like(best.fitted.film.harmonics)),
    )
    fitted = trial.fit(best.parts, start, good)
    if best.degree is not None:
        fitted = add_harmonics(good, fitted, best.degree, trial.width_mm / 2, trial.shift_mm)
    return best._replace(fitted=fitted), good, bad


def _pays(error: float, before: float, trial: _Trial, enough: float = PART_ERROR_RATIO) -> bool:
    share = enough if len(trial.balls.centre) > 1 else SINGLE_BALL_ERROR_RATIO
    return error < share * before and error < before - MIN_GAIN_DEG


def _properties(best: _Model, rest: Rest | None) -> Metrics:
    """Figures: the light left over, and properties of the sensor for which the model has a part."""
    film = best.fitted.film
    said: Metrics = {"led_emission": float(best.fitted.leds[:, 4].mean())}
    if film.diffuse.any():
        said["diffuse_percent"] = float(100 * film.diffuse.mean())
        said["touched_gain"] = film.gain
    if film.refraction > 1:
        said["coat_roughness"], said["coat_index"] = film.roughness, film.refraction
    if film.albedo > 0:
        said["film_albedo"], said["film_rim_mm"] = film.albedo, film.rim
    if film.camera > 0:
        said["camera_mm"] = 1 / film.camera
    said["film_residual_percent"] = 100 * best.fitted.scale
    if rest is not None:
        left = rest_left(rest, best.fitted)
        said["flat_residual_percent"] = 100 * float(np.sqrt(np.square(left).mean()))
    return said
