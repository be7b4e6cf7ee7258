"""Film, LEDs and camera together: a least-squares fit of equation F1 to balls and the flat frame.

The unknowns are each LED's direction, distance, strength and diffuse share; shared parameters
(emission, gain, coat, albedo, rim, pupil); and a shift of every ball.  Balls are coupled only by
the shared unknowns.

Long because all that is fitted, and what else moves with it, passes the same normal equations.
"""

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple, Self, cast

import numpy as np
from scipy.linalg import block_diag
from scipy.special import ndtr

from tactograph.graph import InputError
from tactograph.nodes import F4, F8
from tactograph.nodes.calibrate.ball.balls_on_film import (
    MAX_INDEPENDENT_SAMPLES,
    MAX_ROUNDS,
    Balls,
    Fitted,
    rest_view,
    summed,
)
from tactograph.nodes.calibrate.film.film_unknowns import (
    UNKNOWNS_OF_FLAT_ALONE,
    UNKNOWNS_OF_TOUCH_ALONE,
    Unknowns,
)
from tactograph.nodes.calibrate.lights.descend import (
    DERIVATIVE_STEP,
    NormalEquations,
    descend,
    huber,
    huber_weight,
)
from tactograph.nodes.calibrate.lights.light_samples import LIGHT_DEVIATION, Rest
from tactograph.nodes.optics.film import FADE_WIDTH, place_terms, shades, term_count

MIN_ODDS = 3.0
"""Odds for an unknown that count as evidence; smaller ones are "not worth more than a bare mention"
(R. E. Kass and A. E. Raftery, "Bayes factors", 1995)."""


class Fitting(NamedTuple):
    """A fit of a film's model: its data, free parameters and standard deviations.

    `scale` is the standard deviation of a sample, `certain` that of a block of the flat frame,
    `uneven` that of the brightness of touched film.  `sample_weight` is K x N, 0 to 1, `most` as
    how many independent samples the balls count.
    """

    balls: Balls
    rest: Rest | None
    unknowns: Unknowns
    uneven: float = 0.0
    sample_weight: F8 | float = 1.0
    scale: float = LIGHT_DEVIATION
    certain: float = LIGHT_DEVIATION
    most: float = MAX_INDEPENDENT_SAMPLES

    @classmethod
    def of(
        cls,
        balls: Balls,
        rest: Rest | None,
        parts: Iterable[str],
        uneven: float = 0.0,
        sample_weight: F8 | float = 1.0,
    ) -> Self:
        """Return the fit of a model to balls and, if there is one, the flat frame in blocks.

        Parameters
        ----------
        parts : which of `MODEL_UNKNOWNS` are fitted; all other parameters stay as at the start
        uneven : standard deviation of the brightness of touched film, as a share
        sample_weight : K x N, 0 to 1, how much the light of each sample counts
        """
        return cls(balls, rest, Unknowns.of(parts, balls.width_mm), uneven, sample_weight)

    def fitted(self, start: Fitted) -> Fitted:
        """Return the best film, LEDs and shifts, by a robust Levenberg-Marquardt descent.

        Raises
        ------
        InputError
            If the model has no light for the samples, however it starts.
        """
        first = _Trial.of(self, self.unknowns.opened(start)).judged()
        if not np.isfinite(first.cost()):
            raise InputError(
                "no film has the light of these balls: check the ball's radius and the pixel size, "
                "that balls and flat frame are of one zoom, that the flat frame shows untouched "
                "film, and that the film is a plane at rest unless its shape is given"
            )
        best = descend(first, _Trial.cost, _Trial.linear, _Trial.judged)
        return best.now._replace(scale=best.problem.scale)

    def certainty(self, fitted: Fitted) -> "Certainty":
        """Return how well a fit knows LEDs and film."""
        trial = _Trial.of(self, fitted).judged()
        robust = self.balls.departure(trial.light)
        trial = trial._replace(problem=trial.problem._replace(scale=robust))
        first = self.unknowns.values(fitted).size
        covariance = trial.equations().covariance()[:first, :first]
        return Certainty(covariance, fitted, self.unknowns)

    def further_step(self, fitted: Fitted, light: F8, flat: F8) -> tuple[F8, F8]:
        """Return the best step of V unknowns that the film has not, and their covariance.

        Film, LEDs and balls' places move with them.  `light`, V x K x N, and `flat` are the
        derivatives of the light and of the flat frame by them.
        """
        equations = _Trial.of(self, fitted).judged().equations(light, flat)
        first = self.unknowns.values(fitted).size
        own = slice(first, first + len(light))
        return equations.step(0.0)[own], equations.covariance()[own, own]

    @property
    def each(self) -> float:
        """Weight of a sample."""
        return min(1, self.most / max(self.balls.u.size, 1))

    def normed(self, light: F8) -> F8:
        """Return departures of the light, ... x K x N, in independent standard deviations.

        The root of their covariance, as the LEDs of a sample share its brightness, takes most of
        what another brightness may explain away.
        """
        unit = np.sqrt(self.sample_weight) / (self.scale * self.balls.reference_light)
        light, ball = light * unit, self.balls.light * unit
        square = np.maximum(np.square(ball).sum(axis=0), 1e-12)
        shrink = (1 - 1 / np.sqrt(1 + self.uneven**2 * square)) / square
        return np.asarray(light - shrink * ball * (ball * light).sum(axis=-2, keepdims=True))


class _Trial(NamedTuple):
    """A fit on the way: the problem with its standard deviations, the film, and what it leaves.

    `light` is the model's minus the balls', K x N, `flat` what is left of the flat frame
    (`Fitted.rest_residual`), `view` the light of the film at rest (`rest_view`).
    """

    problem: Fitting
    now: Fitted
    light: F8
    flat: F8
    view: F8 | None

    @classmethod
    def of(cls, problem: Fitting, now: Fitted) -> Self:
        """Return the trial of a film."""
        view, rest = rest_view(problem.balls, now.film), problem.rest
        flat = np.empty((len(now.leds), 0)) if rest is None else now.rest_residual(rest)
        light = now.predicted(problem.balls, view) - problem.balls.light
        return cls(problem, now, light, flat, view)

    def judged(self) -> Self:
        """Return the trial with the standard deviations of its residuals."""
        balls, rest = self.problem.balls, self.problem.rest
        certain = LIGHT_DEVIATION if rest is None else rest.spread(self.flat)
        scale = balls.scale(self.light)
        return self._replace(problem=self.problem._replace(scale=scale, certain=certain))

    def cost(self) -> float:
        """Return the cost in squared standard deviations."""
        problem = self.problem
        deviations = problem.balls.place_deviations
        balls, flat = huber(problem.normed(self.light)), huber(self.flat / problem.certain)
        priors = np.square(self.now.shifts / deviations).sum()
        priors += 2 * problem.unknowns.surprise(self.now)
        return float(problem.each * balls + flat + priors)

    def linear(self) -> Callable[[float], "_Trial"]:
        """Return the trial after a step, by its damping."""
        problem, now, step = self.problem, self.now, self.equations().step
        first = problem.unknowns.values(now).size

        def stepped(damping: float) -> _Trial:
            by = step(damping)
            shifts = by[first:].reshape(now.shifts.shape)
            return self.of(problem, problem.unknowns.moved(now, by[:first], shifts))

        return stepped

    def equations(self, light_by: F8 | None = None, flat_by: F8 | None = None) -> NormalEquations:
        """Return the normal equations of the U unknowns, of further ones, and the P x 3 shifts.

        `light_by` and `flat_by` are the derivatives by the further ones.
        """
        (balls, rest, unknowns, *_), now = self.problem, self.now
        problem, certain, light = self.problem, self.problem.certain, self.light + balls.light

        def other(name: str, other: Fitted) -> F8:
            return other.predicted(balls, self.view if name in UNKNOWNS_OF_TOUCH_ALONE else None)

        step = DERIVATIVE_STEP * float(balls.radius.min())
        moved = [now._replace(shifts=now.shifts + step * axis) for axis in np.eye(3)]
        lifts = [(each.predicted(balls, self.view) - light) / step for each in moved]
        by = unknowns.differences(now, UNKNOWNS_OF_FLAT_ALONE, light, other)
        by = problem.normed(by if light_by is None else np.concatenate([by, light_by]))
        by_own, normed = problem.normed(np.stack(lifts)), problem.normed(self.light)
        weight, spread = problem.each * huber_weight(normed), balls.place_deviations
        sure, away = by * weight, (weight * normed)[None]
        shared, right = summed(sure, by), -summed(by, away)[:, 0]
        mixed = np.hstack([*balls.by_ball(sure, by_own)])
        own = block_diag(*balls.by_ball(by_own * weight, by_own)) + np.diag(spread.ravel() ** -2)
        right_own = -balls.by_ball(by_own, away)[..., 0] - now.shifts * spread**-2
        if rest is not None:
            flat = _by_rest(rest, now, unknowns)
            flat = flat if flat_by is None else np.concatenate([flat, flat_by])
            weight = huber_weight(self.flat / certain) / certain**2
            shared += summed(flat * weight, flat)
            right -= summed(flat, (weight * self.flat)[None])[:, 0]
        departure, usual = unknowns.priors(now)
        first = np.arange(usual.size)
        shared[first, first] += usual**-2
        right[first] -= departure * usual**-2
        normal = np.block([[shared, mixed], [mixed.T, own]])
        return NormalEquations(normal, np.concatenate([right, right_own.ravel()]))


class Certainty(NamedTuple):
    """How well a fit knows its U unknowns, with all others free, such as coat and albedo.

    The covariance U x U, the fit, and its unknowns.
    """

    covariance: F8
    fitted: Fitted
    unknowns: Unknowns

    def shows(self, name: str) -> bool:
        """Return whether an unknown that cannot be below 0 is `MIN_ODDS` times likelier above 0.

        All others stay as they were found with it, since nothing is fitted again.  The odds are the
        density of its prior at 0 over that of its value as fitted (J. M. Dickey, "The weighted
        likelihood ratio, linear hypotheses on normal location parameters", 1971).
        """
        own = self.unknowns.numbers(self.fitted).get(name)
        if own is None:
            return True
        value, prior = (each[own].item() for each in self.unknowns.priors(self.fitted))
        deviation = np.linalg.inv(self.covariance)[own, own].item() ** -0.5
        z = value / deviation
        return math.log(2 * ndtr(z) * deviation / prior) + z * z / 2 > math.log(MIN_ODDS)

    def other_places(self) -> F4:
        """Return LED positions sampled from the uncertainty of the fit, 8 x K x 3 in mm."""
        numbers, width = self.unknowns.numbers(self.fitted), self.unknowns.width_mm
        own = np.stack([numbers[name] for name in ("x", "y", "nearness")], axis=1).ravel()
        return self.fitted.other_places(self.covariance[np.ix_(own, own)], width)


def place_balls(balls: Balls, fitted: Fitted) -> Fitted:
    """Return `fitted` with the balls placed under its known film."""
    known = Unknowns((), balls.width_mm)
    problem = Fitting(balls, None, known, scale=fitted.scale, most=math.inf)
    return descend(_Trial.of(problem, fitted), _Trial.cost, _Trial.linear).now


def add_harmonics(balls: Balls, fitted: Fitted, degree: int) -> Fitted:
    """Add harmonics, with coefficients of a degree in position, to a physical film.

    Ridge regression finds harmonics and gain, in turn with the balls' positions.  Samples with
    large residuals have less weight (Cauchy).
    """
    used, count, now, reach = term_count(degree), len(fitted.leds), fitted, balls.width_mm / 2
    n, *_ = balls.surface(now.shifts, now.film.camera)
    film = fitted.film._replace(flattest=float(np.quantile(n[2], 0.005)), reach=reach)
    physics = fitted._replace(film=film)
    place = place_terms(balls.u / reach, balls.v / reach)[:used]
    weight = 1 / balls.reference_light**2
    # A coefficient is as far from 0 as the light from the model, of which samples count.
    ridge = np.full(count * 8 * used + 1, max(1.0, balls.u.size / MAX_INDEPENDENT_SAMPLES))
    ridge[-1] = 0
    for _ in range(MAX_ROUNDS):
        n, *_ = balls.surface(now.shifts, film.camera)
        shade = shades(n) * np.clip(1 + (n[2] - film.flattest) / FADE_WIDTH, 0, 1)
        basis = (shade[:, None] * place[None]).reshape(8 * used, -1)
        thrown = balls.thrown(now.shifts, film)
        base = physics._replace(shifts=now.shifts).predicted(balls) - thrown
        residual = balls.light - base - thrown
        own = block_diag(*((each * basis) @ basis.T for each in weight))
        gained = ((weight * base) @ basis.T).ravel()
        right = np.append((weight * residual) @ basis.T, (weight * base * residual).sum())
        whole = np.array([[(weight * base * base).sum()]])
        normal = np.block([[own, gained[:, None]], [gained[None], whole]]) + np.diag(ridge)
        change = np.linalg.solve(normal, right)
        harmonics = np.zeros((count, 8, 6))
        harmonics[:, :, :used] = change[:-1].reshape(count, 8, used)
        gain = film.gain * (1 + float(change[-1]))
        now = now._replace(film=film._replace(harmonics=cast(F4, harmonics), gain=gain))
        residual = now.predicted(balls) - balls.light
        now = place_balls(balls, now._replace(scale=balls.scale(residual)))
        away = (balls.light - now.predicted(balls)) / balls.reference_light
        # Cauchy's weights.
        weight = 1 / (1 + (away / (3 * now.scale)) ** 2) / balls.reference_light**2
    return now._replace(scale=balls.scale(now.predicted(balls) - balls.light))


def _by_rest(rest: Rest, now: Fitted, unknowns: Unknowns) -> F8:
    """Derivatives of `Fitted.rest_residual` by the unknowns: U x K x M."""
    without = () if rest.beneath else UNKNOWNS_OF_TOUCH_ALONE
    by = unknowns.differences(now, without, now.at_rest(rest), lambda _, other: other.at_rest(rest))
    return np.asarray(by.mean(axis=1, keepdims=True) - by)
