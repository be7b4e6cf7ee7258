"""Search for the film's model: parts that pay, more samples, harmonics, and bad balls."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from tactograph.graph import warn
from tactograph.nodes import Film, Metrics
from tactograph.nodes.calibrate import FOLD_COUNT
from tactograph.nodes.calibrate.ball.balls_on_film import (
    MAX_INDEPENDENT_SAMPLES,
    MAX_ROUNDS,
    Balls,
    Fitted,
)
from tactograph.nodes.calibrate.film.ball_samples import moved_with
from tactograph.nodes.calibrate.film.film_fit import Fitting, add_harmonics, place_balls
from tactograph.nodes.calibrate.film.film_unknowns import PART_UNKNOWNS, Unknown, Unknowns
from tactograph.nodes.calibrate.lights.descend import HUBER_DEVIATIONS, MAX_STEPS
from tactograph.nodes.calibrate.lights.light_samples import LIGHT_DEVIATION, Rest
from tactograph.nodes.calibrate.rating.verdict import Odds
from tactograph.nodes.optics.film import HARMONIC_DEGREES, lit_share, term_count

SHINING_PARTS = frozenset(("lobe", "bounce"))
"""Parts that may help only together: a coat changes how a film lights itself."""
TOUCHED_PARTS = frozenset({"touched"})
"""Unknowns that direct light alone determines, besides the LEDs."""


class Trial(NamedTuple):
    """The data that every model is fitted to and judged by."""

    balls: Balls
    rest: Rest | None
    samples: Callable[..., Balls]
    """Samples the balls again with another film, shifts, contact radii and further options of
    `FilmEvidence.sample`."""
    figures: Metrics
    """The held-out error of every model tried."""

    def fit(self, parts: frozenset[str], start: Fitted, balls: Balls | None = None) -> Fitted:
        """Fit a model to all samples, or to the given ones.

        Where the gel diffuses light, shadows tell how much.  What they leave unexplained on a
        single ball would bend the LEDs' slants, or be taken for a coat, so all else is then fitted
        to direct light alone, on which slopes rest, and its brightness is as uneven as a plain
        film's.
        """
        balls = balls or self.balls
        fitted = Fitting.of(balls, self.rest, parts).fitted(start)
        if "diffuse" not in parts or len(balls.centre) > 1:
            return fitted
        film, direct = fitted.film, balls.direct(fitted.shifts, fitted.film)
        weight = lit_share(film, direct, np.array(film.contact))
        others = parts - {"diffuse"} | TOUCHED_PARTS
        direct_alone = Fitting.of(balls, self.rest, others, start.film.uneven, weight)
        return direct_alone.fitted(fitted)

    def prefers(self, larger: "Model", model: "Model") -> bool:
        """Return whether a larger model is the better one: likelier, and better held out."""
        return self.odds(larger, model).pays(model.errors, larger.errors)

    def odds(self, larger: "Model", model: "Model") -> Odds:
        """Return the odds of a model over another by the balls and by usual values."""
        both = model, larger
        scales = model.fitted.scale, larger.fitted.scale
        fewer, more = (Unknowns.of(each.parts, self.balls.width_mm) for each in both)
        unusual = more.surprise(larger.fitted) - fewer.surprise(model.fitted)
        values = min(self.balls.u.size, MAX_INDEPENDENT_SAMPLES)
        further = len(more.names) - len(fewer.names)
        return Odds(Odds.of(*scales, further, values).logarithm - unusual)


class Model(NamedTuple):
    """A fitted model: its parts, the harmonics' degree, its held-out error, and that by fold.

    `noises` are the errors that noise alone leaves of the folds.
    """

    parts: frozenset[str]
    degree: int | None
    fitted: Fitted
    error: float
    errors: list[float]
    noises: list[float]
    splits: list[Fitted]
    """The fit without each fold, in the order of `Balls.folds`."""

    def __str__(self) -> str:
        parts = [part for part in ("aim", *PART_UNKNOWNS) if part in self.parts] or ["matt"]
        return "+".join(parts + ([f"harmonics{self.degree}"] if self.degree is not None else []))


def judge(
    trial: Trial,
    parts: frozenset[str],
    fitted: Fitted,
    fold_fits: list[Fitted] | None = None,
    degree: int | None = None,
) -> Model:
    """Measure the error of the normals on each fold by the fit without it."""
    held_out = trial.balls.folds()
    if fold_fits is None:
        fold_fits = [trial.fit(parts, fitted, trial.balls.only(~h)) for h in held_out]
    errors = []
    for test, fold in zip(map(trial.balls.only, held_out), fold_fits, strict=True):
        placed = place_balls(test, fold) if len(fold.shifts) > 1 else fold
        errors.append(placed.normal_error(test))
    degrees, noises = ([float(error[i]) for error in errors] for i in range(2))
    error = float(np.average(degrees, weights=[h.sum() for h in held_out]))
    model = Model(parts, degree, fitted, error, degrees, noises, fold_fits)
    trial.figures[f"film_heldout_deg/{model}"] = error
    return model


def choose(
    trial: Trial, start: Fitted, parts: set[str]
) -> tuple[Model, Balls, list[tuple[Balls, Fitted]]]:
    """Return the film that presses support, of these parts, and the samples of balls that agree.

    Also every pixel of each fold of these, with the film fitted to the other folds.
    """
    listed = [part for part in PART_UNKNOWNS if part in parts]
    found = search(trial, start, listed)
    if "aim" in parts and (left := found[1].fitted.left_at_rest(trial.rest)) > LIGHT_DEVIATION:
        # The axes of points do not show.
        disks = start._replace(film=start.film._replace(emission=1.0))
        aimed = search(trial, disks, listed, frozenset({"aim"}))
        left_by_aimed = aimed[1].fitted.left_at_rest(trial.rest)
        by_flat = Odds.of_frame(left, left_by_aimed, 0, len(start.leds)).logarithm
        odds = Odds(by_flat + trial.odds(aimed[1], found[1]).logarithm)
        if odds.are_sure and not Odds().pays(aimed[1].errors, found[1].errors):
            found = aimed
    trial, best, whole = found
    best = prune(trial, best)
    if "harmonics" in parts and may_grow(best):
        best = bend(trial, best)
    best, balls = without_bad(trial, best)
    good = whole.only(np.isin(whole.ball, balls.ball))
    held_out = zip(map(good.only, trial.balls.folds(good)), best.splits, strict=True)
    return best, balls, [(b, place_balls(b, f)) for b, f in held_out if b.u.size]


def search(
    trial: Trial, start: Fitted, parts: list[str], first: frozenset[str] = frozenset()
) -> tuple[Trial, Model, Balls]:
    """Return the film that presses support, from its first parts, and every pixel of the balls.

    A gel that diffuses light, and a coat whose film lights itself, look alike on the balls at
    first.  So a film that lights itself is compared with the best one that does not, and one that
    does not with a film that is coated and lights itself from the start.
    """
    plain = judge(trial, first, trial.fit(first, start))
    if "bounce" in parts and may_grow(plain):
        trial = trial._replace(balls=trial.samples(start.film))
    best = settle(grow([(trial, plain)], parts))
    if "bounce" in best[1].parts:
        without = [part for part in parts if part != "bounce"]
        smaller, larger = settle(grow([(trial, plain)], without)), best
    elif set(parts) >= SHINING_PARTS and may_grow(best[1]):
        smaller, larger = best, settle(grow([shining(trial, start, SHINING_PARTS | first)], parts))
        # An albedo at its limit is not found.
        if larger[1].fitted.film.albedo == Unknown.of("albedo").high:
            return smaller
    else:
        return best
    return larger if Odds().pays(smaller[1].errors, larger[1].errors) else smaller


def shining(trial: Trial, start: Fitted, parts: frozenset[str]) -> tuple[Trial, Model]:
    """Fit a coated film that lights itself, from usual values, and sample the balls with it."""
    fitted = Fitting.of(trial.balls, trial.rest, parts).unknowns.opened(start)
    trial, placed = _sampled_again(trial, fitted)
    return trial, judge(trial, parts, trial.fit(parts, placed))


def grow(path: list[tuple[Trial, Model]], parts: list[str]) -> list[tuple[Trial, Model]]:
    """Add parts to the last model one by one, as long as that pays; return the models.

    A part pays if the film is likelier with it, given how usual its values are, and if it lowers
    the held-out error (`Odds.pays`).  Once the film has a coat or an albedo, the samples are
    renewed: then the light that it reflects from film to film is known.
    """
    trial, best = path[-1]
    while may_grow(best) and (untried := [part for part in parts if part not in best.parts]):
        wider = [best.parts | {part} for part in untried]
        fitted = [trial.fit(parts, best.fitted) for parts in wider]
        # Only the part that explains the presses best is judged on held-out samples.
        first = int(np.argmin([each.normal_error(trial.balls).degrees for each in fitted]))
        better = judge(trial, wider[first], fitted[first])
        if not trial.prefers(better, best):
            break
        if better.fitted.film.lights_itself:
            resampled, placed = _sampled_again(trial, better.fitted)
            better = judge(resampled, better.parts, resampled.fit(better.parts, placed))
            # Renewed samples of a coat show light from film to film, which the next part explains.
            explains_all = "bounce" in better.parts or "bounce" not in parts
            if explains_all and Odds().pays(better.errors, best.errors):
                break
            trial = resampled
        best = better
        path = [*path, (trial, best)]
    return path


def _sampled_again(trial: Trial, fitted: Fitted, **options: Any) -> tuple[Trial, Fitted]:
    """Sample again with a better-known film, up to where it leaves the balls."""
    before = trial.balls
    balls = trial.samples(fitted.film, shifts=fitted.shifts, rim=before.rim, **options)
    shifts = moved_with(fitted.shifts, balls.radius, before.rim, balls.rim)
    return trial._replace(balls=balls), fitted._replace(shifts=shifts)


def settle(path: list[tuple[Trial, Model]]) -> tuple[Trial, Model, Balls]:
    """Fit the last model to more samples until the light from film to film converges.

    That is no more than the film's own light: a smaller share of it than light departs by by
    itself is not seen.  As films may go in circles, rounds beyond `MAX_ROUNDS` must leave less.
    If the model then errs more than the one before it, which had a part less, that one is settled
    in its place.  Also returns every pixel of the balls.
    """
    (trial, best), left = path[-1], np.inf
    for number in range(1, MAX_STEPS):
        before, rim = best.fitted, trial.balls.rim
        trial, placed = _sampled_again(trial, best.fitted, most=None, fine=True)
        whole = trial.balls
        trial = trial._replace(balls=whole.thinned(last=True))
        best = best._replace(fitted=trial.fit(best.parts, placed))
        moved = np.abs(whole.rim / rim - 1).max()
        changed, albedo = abs(best.fitted.film.albedo - before.film.albedo), before.film.albedo
        stays = albedo == 0 or max(changed / albedo, moved) < LIGHT_DEVIATION
        former, left = left, unexplained(trial.balls, best.fitted)
        if stays or (number >= MAX_ROUNDS and left >= former):
            break
    best = judge(trial, best.parts, best.fitted)
    if len(path) > 1 and best.error > path[-2][1].error:
        return settle(path[:-1])
    return trial, best, whole


def unexplained(balls: Balls, fitted: Fitted) -> float:
    """Return what a film leaves of the light, also where that is less than light departs by."""
    return balls.departure(fitted.predicted(balls) - balls.light)


def prune(trial: Trial, best: Model) -> Model:
    """Drop parts that do not pay: without them a film is as likely, and errs as little.

    Those are tried whose light is less than the film leaves unexplained.
    """
    few, settled = trial._replace(balls=trial.balls.thinned(), figures={}), best.parts
    for part in sorted(settled & PART_UNKNOWNS.keys()):
        film, parts = best.fitted.film, best.parts - {part}
        plain = Film.matt(film.lights)._asdict()
        off = film._replace(**{name: plain[name] for name in PART_UNKNOWNS[part]})
        without = best.fitted._replace(film=off)
        change = without.predicted(few.balls) - best.fitted.predicted(few.balls)
        if np.square(change / few.balls.reference_light).mean() > best.fitted.scale**2:
            continue
        both = (best.parts, best.fitted), (parts, without)
        larger, smaller = (judge(few, each, few.fit(each, begun)) for each, begun in both)
        if not few.prefers(larger, smaller):
            best = best._replace(parts=parts, fitted=trial.fit(parts, smaller.fitted))
    return best if best.parts == settled else judge(trial, best.parts, best.fitted)


def bend(trial: Trial, best: Model) -> Model:
    """Add harmonics of the highest degree that pays; balls must outnumber their terms."""
    physics = best
    for degree in HARMONIC_DEGREES:
        if len(trial.balls.centre) <= term_count(degree):
            break
        held_out = zip(trial.balls.folds(), physics.splits, strict=True)
        fold_fits = [add_harmonics(trial.balls.only(~h), fold, degree) for h, fold in held_out]
        candidate = judge(trial, physics.parts, physics.fitted, fold_fits, degree)
        if Odds().pays(best.errors, candidate.errors):
            best = candidate
    if best.degree is not None:
        best = best._replace(fitted=add_harmonics(trial.balls, best.fitted, best.degree))
    return best


def without_bad(trial: Trial, best: Model) -> tuple[Model, Balls]:
    """Leave out outliers among many balls: scratched, dirty, or no balls.

    Also returns the samples of the others.
    """
    balls, count = trial.balls, len(trial.balls.centre)
    squares = np.square(balls.light - best.fitted.predicted(balls)).mean(axis=0)
    by_ball = np.sqrt(np.bincount(balls.ball, squares, count) / np.bincount(balls.ball))
    bad = by_ball > HUBER_DEVIATIONS * np.median(by_ball)
    # Each fold has another ball that tells which one departs.
    if count < 2 * FOLD_COUNT or not bad.any():
        return best, balls
    where = ", ".join(f"({x:.2f}, {y:.2f})" for x, y in balls.centre[bad])
    warn(f"{bad.sum()} of {count} balls depart from the others and are left out: at {where} mm")
    good, film = balls.only(~bad[balls.ball]), best.fitted.film
    plain = film._replace(harmonics=np.zeros_like(film.harmonics))
    fitted = trial.fit(best.parts, best.fitted._replace(film=plain), good)
    if best.degree is not None:
        fitted = add_harmonics(good, fitted, best.degree)
    return best._replace(fitted=fitted), good


def may_grow(best: Model) -> bool:
    """Return whether another part may pay: a perfect model, which leaves noise alone, would."""
    return Odds().pays(best.errors, best.noises)
