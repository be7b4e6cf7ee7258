"""Refit a film's model to a check press on a new film; camera and LEDs stay the same.

Long because each property that may change has its prior and its figures.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.rings.recheck.nodes import MAX_INDEPENDENT
from tactograph.sdk import (
    F4,
    F8,
    Film,
    FilmEvidence,
    FoundBalls,
    Light,
    Misfit,
    NodeCall,
    Noise,
    Odds,
    PixelSize,
    SheetLight,
    SizeLimit,
    node,
    warn,
)
from tactograph.sdk.nodes import film_bounce

SHALLOW_SHARE = 0.5
"""Smallest slopes of a check press, as a share of those pressed for the calibration."""
THICKNESS_DEVIATION_MM = 0.3
"""Standard deviation of the thickness of a gel."""
COAT_UNKNOWNS = "base", "roughness", "refraction"
ANOTHER_GEL = "thicker", "gain", "diffuse", "albedo", "rim"
FILM_CHANGES = (("thicker",), ANOTHER_GEL, (*ANOTHER_GEL, *COAT_UNKNOWNS))
"""The changes tried, the simplest first: another thickness in mm, another gel, another coat.
`diffuse` is added to the share of every LED."""


class FilmRefit(NamedTuple):
    """The new film, its misfit, and the pixel size on it."""

    film: Film
    misfit: Misfit
    pixel_size: PixelSize
    quality: dict[str, float]


class _Samples:
    """Samples of the check press, with the light that a film throws on itself: all, and some."""

    def __init__(
        self, evidence: FilmEvidence, film: Film, *, last: bool = False, **options: Any
    ) -> None:
        self.all = evidence.sample(film, most=None, **options)
        self.some = self.all.thinned(last=last)


class _Prior:
    """The fit's starting point: the old film, and how the flat frame changed.

    `light` is the ratio of its brightness, `ratio` the change of its fall-off's logarithm; none if
    either frame is uniform, because none was taken.
    """

    def __init__(self, film: Film, evidence: FilmEvidence, before: F4) -> None:
        now, then = evidence.rest(), evidence._replace(flat=before).rest()
        self.film, self.fall = film, None if then is None else now
        self.matt = evidence.start()._replace(leds=np.zeros((len(before), 4)))
        self.light, self.ratio = 1.0, np.zeros((len(before), 0))
        if now is not None and then is not None:
            self.light = float(np.median(evidence.flat) / np.median(before))
            self.ratio = _level(now.logarithm - then.logarithm)


class _Refitted:
    """A fit: the changes by name, the film, and the shifts of the balls."""

    def __init__(self, prior: _Prior, changed: dict[str, float], film: Film, shifts: F8) -> None:
        self.changed, self.film, self.shifts = changed, film, shifts
        self.fitted = prior.matt._replace(film=film, shifts=shifts)

    def scale(self, samples: _Samples) -> float:
        """Standard deviation of what the fit leaves of the balls' light."""
        balls = samples.some
        return balls.scale(self.fitted.predicted(balls) - balls.light)


@node(sizes={"K": SizeLimit(3, 8, "two LEDs leave two slopes, a label has 8 bits")})
def refit_film(
    light: SheetLight,
    flat: Light,
    before: Light,
    balls: FoundBalls,
    film: Film,
    old_misfit: Misfit,
    noise: Noise,
    pixel: PixelSize,
    even_pixel: PixelSize,
    *,
    bounce: NodeCall = film_bounce,
) -> FilmRefit:
    """Return the model of a new film: the old one, with the changes that a check press shows.

    The LEDs stay where they are.  A thicker gel puts the film farther from all of them and from
    the camera; a new film may diffuse more, be brighter or be glossier.  Robust least squares
    with priors fits these few parameters to the check press and to the change of the flat
    frame's fall-off.  Each prior holds a parameter near its old value, as films of one kind
    differ; the albedo's takes the flat frame's brightness into account.  The thickness is always
    fitted.  Changes of the gel, and then of the coat, are accepted if they are likelier, and lower
    the error on held-out quarters of the press by more than a standard error (`Odds.pays`).  Where
    only the new film lights itself, it is fitted once more, to more samples, with that light
    known, and the better of both on what is held out is taken.  The old film's harmonics
    are dropped if that lowers the error as much.

    Parameters
    ----------
    light : K x S x W, the check press or presses relative to the new film at rest, on a sheet
    flat, before : K x H x W, the new and the old film at rest
    balls : as `find_balls` returns them; a contact radius of 0 means that there is no ball
    film, old_misfit : of the old calibration
    noise : (shot, read), a captured light I has the variance shot * I + read
    pixel : mm per px on the old film
    even_pixel : mm per px, the camera's own pixels, if `light` is binned

    Returns
    -------
    The `Film`; its misfit, no less than the old one's; the camera's pixel size on the new film; and
    figures: ``check_deg/before`` and ``check_deg/held_out``, the error of the normals on the check
    press with the old and the new film, and what has changed.
    """
    typed: dict[str, Any] = {
        n: np.asarray(v, np.float64) if np.ndim(v) else v for n, v in film._asdict().items()
    }
    precise = Film(**typed)
    if not (balls.circle[:, 2] > 0).any():
        return _result(precise, film, old_misfit, even_pixel, {})
    every = np.ones(light.shape[1] // flat.shape[1], np.uint8)
    strength = np.ones(len(flat), np.float32)
    found, placed = (balls.circle, balls.radius, balls.of), (every, film.lights, strength)
    evidence = FilmEvidence(light, flat, *found, *placed, noise, pixel).used()
    samples = _Samples(evidence, film, bounce=bounce)
    if (slope := samples.some.pressed_slope) < SHALLOW_SHARE * film.pressed_slope:
        warn(
            f"the check press has slopes of up to {slope:.2f}, the calibration's presses of up to "
            f"{film.pressed_slope:.2f}: press as deep as slopes will be, and recalibrate"
        )
    prior = _Prior(precise, evidence, before)
    before_error = float(np.mean(_judged(prior, samples, ())[1]))
    best, errors, fold_fits = _choose(prior, samples)
    if best.film.albedo > 0 and not film.lights_itself:
        # Now the light that the new film reflects from film to film is known.
        placed_at: dict[str, Any] = {"shifts": best.shifts, "rim": samples.some.rim}
        renewed = _Samples(evidence, best.film, last=True, **placed_at, fine=True, bounce=bounce)
        other = _choose(prior, renewed)
        if np.mean(other[1]) < np.mean(errors):
            samples, (best, errors, fold_fits) = renewed, other
    if precise.harmonics.any():
        plain = precise._replace(harmonics=np.zeros_like(precise.harmonics))
        other = _choose(_Prior(plain, evidence, before), samples)
        if Odds().pays(errors, other[1]):
            best, errors, fold_fits = other
    some, folds = samples.some, samples.some.folds(samples.all)
    parts = zip(map(samples.all.only, folds), fold_fits, strict=True)
    held_out = evidence.held_out([(part, fold.fitted) for part, fold in parts])
    uneven = held_out.unevenness()
    new_misfit = held_out.misfit(film, uneven)
    rough = some.grain(some.light - best.fitted.predicted(some), flat, noise)
    figures = {"check_deg/before": before_error, "check_deg/held_out": float(np.mean(errors))}
    thicker = best.changed.get("thicker", 0.0)
    return _result(
        best.film._replace(grain=max(rough, film.grain), uneven=max(uneven, film.uneven)),
        film,
        np.maximum(new_misfit, old_misfit),
        even_pixel * (1 + film.camera * thicker),
        figures | _changes(film, best.film, thicker),
    )


def _result(
    new: Film, old: Film, residual: F4, pixel: float, figures: dict[str, float]
) -> FilmRefit:
    film = new.stored()
    moved = np.asarray(old.other_lights + (film.lights - old.lights), np.float32)
    film = film._replace(other_lights=moved)
    return FilmRefit(film, np.asarray(residual, np.float32), pixel, figures)


def _changes(old: Film, new: Film, thicker: float) -> dict[str, float]:
    """The changes of the film, in practical units."""
    diffuse = float(np.mean(new.diffuse - old.diffuse))
    return {
        "thicker_mm": thicker,
        "diffuse_percent/before": 100 * float(np.mean(old.diffuse)),
        "diffuse_percent/now": 100 * float(np.mean(old.diffuse) + diffuse),
        "film_albedo/before": float(old.albedo),
        "film_albedo/now": float(new.albedo),
        "coat_roughness/before": float(old.roughness),
        "coat_roughness/now": float(new.roughness),
        "coat_index/before": float(old.refraction),
        "coat_index/now": float(new.refraction),
    }


def _level(logarithm: F8) -> F8:
    """Remove the LEDs' common part, which is albedo, and each LED's strength."""
    shared = logarithm - logarithm.mean(axis=0)
    return np.asarray(shared - np.median(shared, axis=1, keepdims=True))


def _choose(prior: _Prior, samples: _Samples) -> tuple[_Refitted, list[float], list[_Refitted]]:
    """The simplest change that the held-out quarters support, its error and its folds."""
    best, errors, fold_fits = _judged(prior, samples, FILM_CHANGES[0])
    values = min(samples.some.u.size, MAX_INDEPENDENT * len(samples.some.centre))
    for names in FILM_CHANGES[1:]:
        candidate = _judged(prior, samples, names)
        scales = best.scale(samples), candidate[0].scale(samples)
        odds = Odds.of(*scales, len(names) - len(best.changed), values)
        if odds.pays(errors, candidate[1]):
            best, errors, fold_fits = candidate
    return best, errors, fold_fits


def _judged(
    prior: _Prior, samples: _Samples, names: tuple[str, ...]
) -> tuple[_Refitted, list[float], list[_Refitted]]:
    """The fit to all samples, the held-out error, and the fit without each fold."""
    whole, some = _fit(prior, samples, names, {}), samples.some
    fold_fits, errors = [], []
    for held_out in some.folds():
        fold = _fit(prior, samples, names, whole.changed, held_out)
        fold_fits.append(fold)
        errors.append(fold.fitted.normal_error(some.only(held_out)).degrees)
    return whole, errors, fold_fits


def _changed(film: Film, names: dict[str, float]) -> Film:
    """The film after a change."""
    values: dict[str, Any] = dict(names)
    thicker, diffuse = values.pop("thicker", 0.0), values.pop("diffuse", 0.0)
    values["diffuse"] = film.diffuse + diffuse
    fields: dict[str, Any] = {
        name: FilmEvidence.prior(name).within(value) for name, value in values.items()
    }
    return film._replace(
        lights=film.lights + np.array([0, 0, thicker]),
        camera=film.camera / (1 + film.camera * thicker),
        **fields,
    )


def _usual(prior: _Prior, name: str) -> tuple[float, float]:
    """What is expected of a change, or of the new value of a parameter, and the deviation."""
    if name == "thicker":
        return 0.0, THICKNESS_DEVIATION_MM
    first, old = FilmEvidence.prior(name), prior.film
    if name == "diffuse":
        return 0.0, first.spread
    if name in COAT_UNKNOWNS and old.refraction == 1:
        return first.start, first.spread
    # The LEDs stay, so a film at rest that is darker reflects less.
    return getattr(old, name) * (prior.light if name == "albedo" else 1), first.spread


def _fit(
    prior: _Prior,
    samples: _Samples,
    names: tuple[str, ...],
    start: dict[str, float],
    held_out: NDArray[np.bool_] | None = None,
) -> _Refitted:
    """Fit the named changes and the balls' positions, with priors."""
    balls = samples.some if held_out is None else samples.some.only(~held_out)
    film, fall, count = prior.film, prior.fall, len(balls.centre)
    about = [_usual(prior, name) for name in names]
    usual = np.concatenate([np.zeros(3 * count), [first for first, _ in about]])
    places = balls.place_deviations.ravel()
    spread = np.concatenate([places, [deviation for _, deviation in about]])

    before = _Refitted(prior, {}, film, np.zeros((count, 3))).fitted
    level = 0.0 if fall is None else before.at_rest(fall)
    # Without a change, the flat frames tell how alike they are.
    blocks = 1.0 if fall is None else fall.spread(prior.ratio)

    def at(values: F8) -> _Refitted:
        named = dict(zip(names, values[3 * count :].tolist(), strict=True))
        shifts = values[: 3 * count].reshape(-1, 3)
        return _Refitted(prior, named, _changed(film, named), shifts)

    def residuals(values: F8) -> F8:
        candidate = at(values)
        # On a film that is farther from the camera, positions are scaled.
        scale = 1 + film.camera * candidate.changed.get("thicker", 0.0)
        farther = {name: getattr(balls, name) * scale for name in ("u", "v", "centre", "rim")}
        light = candidate.fitted.predicted(replace(balls, **farther))
        parts = [((balls.light - light) / whole).ravel(), (values - usual) / spread]
        if names and fall is not None:
            farther = {name: getattr(fall, name) * scale for name in ("x", "y")}
            fallen = candidate.fitted.at_rest(replace(fall, **farther)) - level
            parts.append(((prior.ratio - _level(fallen)) / blocks).ravel())
        return np.concatenate(parts)

    deviation = before.scale * np.sqrt(max(balls.u.size / MAX_INDEPENDENT / count, 1))
    whole, begin = balls.reference_light * deviation, usual.copy()
    begin[3 * count :] = [start.get(n, first) for n, (first, _) in zip(names, about, strict=True)]
    return at(FilmEvidence.least_squares(residuals, begin, spread))
