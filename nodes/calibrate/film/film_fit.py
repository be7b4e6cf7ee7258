"""Film, LEDs and camera together: a least-squares fit of equation F1 to balls and the flat frame.

The unknowns are each LED's direction, distance, strength, emission and diffuse share; shared
parameters (gain, coat, albedo, rim, pupil); and a shift of every ball.  Balls are coupled only by
the shared unknowns, so the shifts are eliminated ball by ball (Schur's complement), for one ball
as for a hundred.

Long because all that is fitted, and what else moves with it, passes the same normal equations.
"""

import math
from collections.abc import Callable
from typing import NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError
from tactograph.nodes import DEVIATIONS_PER_MAD, F4, F8
from tactograph.nodes.calibrate.ball.balls_on_film import Balls, Fitted, predicted, rest_view
from tactograph.nodes.calibrate.film.film_at_rest import by_rest, rest_residual, rest_spread
from tactograph.nodes.calibrate.film.film_unknowns import (
    EMISSION_UNKNOWN,
    UNKNOWNS_OF_FLAT_ALONE,
    UNKNOWNS_OF_TOUCH_ALONE,
    UNKNOWNS_PER_LED,
    differences,
    moved_by,
    numbered,
    opened,
    priors,
    surprise,
    unknowns_of,
)
from tactograph.nodes.calibrate.lights.descend import DERIVATIVE_STEP, descend, huber, huber_weight
from tactograph.nodes.calibrate.lights.light_fit import (
    HEIGHT_DEVIATION_MM,
    LIGHT_DEVIATION,
    inverse_places,
    places_within,
)
from tactograph.nodes.calibrate.lights.light_samples import Rest
from tactograph.nodes.optics.film import FADE_WIDTH, matt_film, place_terms, shades, term_count

MAX_INDEPENDENT_SAMPLES = 1500
"""Most independent samples that the balls count as.  More have less noise, but a model's residuals
on a real film are correlated."""
MAX_ROUNDS = 4
"""Most rounds in which what depends on one another is found in turn: harmonics or light from film
to film and the balls' positions, a bend and the film, or a normal and the light about it."""


class _Residuals(NamedTuple):
    """Residuals of the balls' light, K x N, and of the flat frame (`rest_residual`)."""

    light: F8
    flat: F8


class _Problem(NamedTuple):
    """The data of the fit, the free parameters, and the standard deviations.

    `scale` is the standard deviation of a sample, `certain` that of a block of the flat frame,
    `uneven` that of the brightness of touched film.  `sample_weight` is K x N, 0 to 1.
    """

    balls: Balls
    rest: Rest | None
    names: list[str]
    shift_mm: float
    width_mm: float
    uneven: float = 0.0
    sample_weight: F8 | float = 1.0
    scale: float = LIGHT_DEVIATION
    certain: float = LIGHT_DEVIATION

    @property
    def each(self) -> float:
        """Weight of a sample."""
        return min(1, MAX_INDEPENDENT_SAMPLES / max(self.balls.u.size, 1))

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

    def residuals(self, now: Fitted) -> _Residuals:
        """Return the residuals of a fit."""
        flat = np.empty((len(now.leds), 0)) if self.rest is None else rest_residual(self.rest, now)
        return _Residuals(predicted(self.balls, now) - self.balls.light, flat)

    def judged(self, residuals: _Residuals) -> Self:
        """Return the problem with the standard deviations of residuals."""
        certain = LIGHT_DEVIATION if self.rest is None else rest_spread(residuals.flat, self.rest)
        return self._replace(scale=light_scale(self.balls, residuals.light), certain=certain)


class _Trial(NamedTuple):
    """A fit on the way: the problem with its standard deviations, the film, and the residuals."""

    problem: _Problem
    now: Fitted
    residuals: _Residuals

    @classmethod
    def of(cls, problem: _Problem, now: Fitted) -> Self:
        """Return the trial of a film."""
        return cls(problem, now, problem.residuals(now))

    def judged(self) -> Self:
        """Return the trial with the standard deviations of its residuals."""
        return self._replace(problem=self.problem.judged(self.residuals))

    def cost(self) -> float:
        """Return the cost in squared standard deviations."""
        return _cost(*self)

    def linear(self) -> Callable[[float], "_Trial"]:
        """Return the trial after a step, by its damping."""
        equations = _equations(*self)

        def stepped(damping: float) -> _Trial:
            by = _solve(equations, damping)
            return self.of(self.problem, moved_by(self.now, self.problem.names, *by))

        return stepped


class Further(NamedTuple):
    """Derivatives by U unknowns that the film has not: of light, U x K x N, and flat frame."""

    light: F8
    flat: F8


class _Equations(NamedTuple):
    """Normal equations: shared G x G, mixed P x G x 3, own P x 3 x 3, and right-hand sides."""

    shared: F8
    mixed: F8
    own: F8
    right: F8
    right_own: F8


def fit(
    balls: Balls,
    rest: Rest | None,
    parts: frozenset[str],
    start: Fitted,
    shift_mm: float,
    width_mm: float,
    uneven: float = 0.0,
    sample_weight: F8 | float = 1.0,
) -> Fitted:
    """Return the best film, LEDs and shifts, by a robust Levenberg-Marquardt descent.

    Parameters
    ----------
    balls : the samples
    rest : the flat frame in blocks, if there is one
    parts : which of `MODEL_UNKNOWNS` are fitted; all other parameters stay as in `start`
    start : start values of the descent
    shift_mm : standard deviation of a ball's position
    width_mm : width of the film that the camera sees
    uneven : standard deviation of the brightness of touched film, as a share
    sample_weight : K x N, 0 to 1, how much the light of each sample counts

    Raises
    ------
    InputError
        If the model has no light for the samples, however it starts.
    """
    names = unknowns_of(parts)
    problem = _Problem(balls, rest, names, shift_mm, width_mm, uneven, sample_weight)
    first = _Trial.of(problem, opened(start, names)).judged()
    if not np.isfinite(first.cost()):
        raise InputError(
            "no film has the light of these balls: check the ball's radius and the pixel size, "
            "that balls and flat frame are of one zoom, that the flat frame shows untouched "
            "film, and that the film is a plane at rest unless its shape is given"
        )
    best = descend(first, _Trial.cost, _Trial.linear, _Trial.judged)
    return best.now._replace(scale=best.problem.scale)


class Certainty(NamedTuple):
    """How well a fit knows its shared unknowns, with all others free, such as coat and albedo.

    The covariance G x G, the unknowns' numbers by name, and how many independent values tell them.
    """

    covariance: F8
    numbers: dict[str, NDArray[np.intp]]
    values: float

    def shows(self, name: str, value: float) -> bool:
        """Return whether an unknown is likelier to be its (mean) value than 0 (`log_odds`).

        All others stay as they were found with it, since nothing is fitted again.
        """
        if name not in self.numbers:
            return True
        own = self.numbers[name]
        information = float(np.linalg.inv(self.covariance)[np.ix_(own, own)].sum())
        return value**2 * information > math.log(self.values)

    def other_places(self, leds: F8, width_mm: float) -> F4:
        """Return LED positions sampled from the uncertainty of the fit, 8 x K x 3 in mm."""
        own = (UNKNOWNS_PER_LED * np.arange(len(leds))[:, None] + np.arange(3)).ravel()
        return places_within(leds[:, :3], self.covariance[np.ix_(own, own)], width_mm)


def certainty(
    balls: Balls,
    rest: Rest | None,
    parts: frozenset[str],
    fitted: Fitted,
    shift_mm: float,
    width_mm: float,
) -> Certainty:
    """Return how well a fit knows LEDs and film."""
    names = unknowns_of(parts)
    problem = _Problem(balls, rest, names, shift_mm, width_mm)
    residuals = problem.residuals(fitted)
    robust = _robust_spread(residuals.light / balls.reference_light)
    covariance = _covariance(
        _equations(problem.judged(residuals)._replace(scale=robust), fitted, residuals)
    )
    return Certainty(covariance, numbered(fitted, names), problem.each * balls.u.size)


def further_step(
    balls: Balls,
    rest: Rest,
    parts: frozenset[str],
    fitted: Fitted,
    further: Further,
    shift_mm: float,
    width_mm: float,
) -> tuple[F8, F8]:
    """Return the best step of unknowns that the film has not, and their covariance.

    Film, LEDs and balls' places move with them.
    """
    problem = _Problem(balls, rest, unknowns_of(parts), shift_mm, width_mm)
    residuals = problem.residuals(fitted)
    equations = _equations(problem.judged(residuals), fitted, residuals, further)
    by, _ = _solve(equations, 0.0)
    first = len(by) - len(further.light)
    return by[first:], _covariance(equations)[first:, first:]


def place_balls(balls: Balls, fitted: Fitted, shift_mm: float) -> Fitted:
    """Return `fitted` with the balls placed under its known film."""
    now, scale = fitted, fitted.scale
    spread, rest = place_deviations(balls, shift_mm), rest_view(balls, fitted.film)
    for _ in range(10):
        residual = predicted(balls, now, rest) - balls.light
        by = _by_shift(balls, now, residual + balls.light, rest)
        weight = _weight(balls, residual, scale)
        normal = balls.by_ball(by * weight, by) + _diagonals(spread**-2)
        right = -balls.by_ball(by, (weight * residual)[None])[..., 0] - now.shifts * spread**-2
        step = np.clip(np.linalg.solve(normal, right[..., None])[..., 0], -spread, spread)
        now = now._replace(shifts=now.shifts + step)
        if np.abs(step[:, :2]).max() < 1e-3 * shift_mm:
            break
    return now


def place_deviations(balls: Balls, shift_mm: float) -> F8:
    """Return standard deviations of the balls' positions in x, y and z, P x 3.

    For a ball smaller than 1 mm in radius, that in z shrinks with the radius.
    """
    lift = HEIGHT_DEVIATION_MM * np.minimum(1, balls.radius)
    return np.column_stack([np.full((len(lift), 2), shift_mm), lift])


def _diagonals(values: F8) -> F8:
    return np.asarray(values[:, :, None] * np.eye(values.shape[1]))


def add_harmonics(
    balls: Balls, fitted: Fitted, degree: int, reach: float, shift_mm: float
) -> Fitted:
    """Add harmonics, with coefficients of a degree in position, to a physical film.

    Ridge regression finds harmonics and gain, in turn with Gauss-Newton steps for the balls'
    positions.  Samples with large residuals have less weight (Cauchy).
    """
    used = term_count(degree)
    count, size, now = len(fitted.leds), 8 * used, fitted
    n, *_ = balls.surface(now.shifts, now.film.camera)
    film = fitted.film._replace(flattest=float(np.quantile(n[2], 0.005)), reach=reach)
    physics = fitted._replace(film=film)
    place = place_terms(balls.u / reach, balls.v / reach)[:used]
    weight = 1 / balls.reference_light**2
    # A coefficient is as far from 0 as the light from the model, of which samples count.
    ridge = np.full(count * size + 1, max(1.0, balls.u.size / MAX_INDEPENDENT_SAMPLES))
    ridge[-1] = 0
    for _ in range(MAX_ROUNDS):
        n, *_ = balls.surface(now.shifts, film.camera)
        shade = shades(n) * np.clip(1 + (n[2] - film.flattest) / FADE_WIDTH, 0, 1)
        basis = (shade[:, None] * place[None]).reshape(size, -1)
        thrown = balls.thrown(now.shifts, film)
        base = predicted(balls, physics._replace(shifts=now.shifts)) - thrown
        residual = balls.light - base - thrown
        normal, right = np.diag(ridge), np.zeros(count * size + 1)
        for k in range(count):
            of_led, weighted = slice(k * size, (k + 1) * size), basis * weight[k]
            normal[of_led, of_led] += weighted @ basis.T
            normal[of_led, -1] = normal[-1, of_led] = weighted @ base[k]
            right[of_led] = weighted @ residual[k]
            normal[-1, -1] += (weight[k] * base[k]) @ base[k]
            right[-1] += (weight[k] * base[k]) @ residual[k]
        change = np.linalg.solve(normal, right)
        harmonics = np.zeros((count, 8, 6))
        harmonics[:, :, :used] = change[:-1].reshape(count, 8, used)
        gain = film.gain * (1 + float(change[-1]))
        now = now._replace(film=film._replace(harmonics=cast(F4, harmonics), gain=gain))
        residual = predicted(balls, now) - balls.light
        now = place_balls(balls, now._replace(scale=light_scale(balls, residual)), shift_mm)
        away = (balls.light - predicted(balls, now)) / balls.reference_light
        # Cauchy's weights.
        weight = 1 / (1 + (away / (3 * now.scale)) ** 2) / balls.reference_light**2
    return now._replace(scale=light_scale(balls, predicted(balls, now) - balls.light))


def _weight(balls: Balls, residual: F8, scale: float) -> F8:
    """Weights of the samples' residuals in the normal equations."""
    deviation = scale * balls.reference_light
    return np.asarray(huber_weight(residual / balls.reference_light / scale) / deviation**2)


def light_scale(balls: Balls, residual: F8) -> float:
    """Return the robust standard deviation of a sample's residual."""
    return max(LIGHT_DEVIATION, _robust_spread(residual / balls.reference_light))


def _robust_spread(residual: F8) -> float:
    return DEVIATIONS_PER_MAD * float(np.median(np.abs(residual)))


def _cost(problem: _Problem, now: Fitted, errors: _Residuals) -> float:
    deviations = place_deviations(problem.balls, problem.shift_mm)
    total = float(np.square(now.shifts / deviations).sum())
    total += problem.each * huber(problem.normed(errors.light)) + huber(
        errors.flat / problem.certain
    )
    total += float(now.leds[:, 3].mean() ** 2)
    return total + 2 * surprise(now, problem.names, problem.width_mm)


def _equations(
    problem: _Problem, now: Fitted, residuals: _Residuals, further: Further | None = None
) -> _Equations:
    balls, rest, names, shift_mm, width_mm, *_, certain = problem
    at_rest = rest_view(balls, now.film)
    light, normed = residuals.light + balls.light, problem.normed(residuals.light)
    by_own = problem.normed(_by_shift(balls, now, light, at_rest))
    by = _by_shared(balls, now, names, light, at_rest)
    by = problem.normed(by if further is None else np.concatenate([by, further.light]))
    weight = problem.each * huber_weight(normed)
    spread = place_deviations(balls, shift_mm)
    sure, away = by * weight, (weight * normed)[None]
    shared = sure.reshape(len(by), -1) @ by.reshape(len(by), -1).T
    right = -(by.reshape(len(by), -1) @ away.ravel())
    mixed = balls.by_ball(sure, by_own)
    by_shift = balls.by_ball(by_own * weight, by_own) + _diagonals(spread**-2)
    right_own = -balls.by_ball(by_own, away)[..., 0] - now.shifts * spread**-2
    if rest is not None:
        flat = by_rest(rest, now, names)
        flat = (flat if further is None else np.concatenate([flat, further.flat])).reshape(
            len(by), -1
        )
        flat_weight = (huber_weight(residuals.flat / certain) / certain**2).ravel()
        shared += (flat * flat_weight) @ flat.T
        right -= flat @ (flat_weight * residuals.flat.ravel())
    # The flat frame leaves the strengths' common factor free; without one, all of them are free.
    # So a prior holds them.
    strengths = np.arange(3, now.leds.size, UNKNOWNS_PER_LED)
    ridge = 1 / len(strengths) ** 2 if rest is not None else np.eye(len(strengths))
    shared[np.ix_(strengths, strengths)] += ridge
    right[strengths] -= now.leds[:, 3].mean() / len(strengths)
    for j, away_from, sure_of in priors(now, names, width_mm):
        shared[j, j] += sure_of**-2
        right[j] -= away_from / sure_of**2
    return _Equations(shared, mixed, by_shift, right, right_own)


def _by_shift(balls: Balls, now: Fitted, before: F8, rest: F8 | None) -> F8:
    """Derivatives of the light `before`, K x N, by the balls' shifts, 3 x K x N.

    `rest` is the result of `rest_view`.
    """
    step = DERIVATIVE_STEP * float(balls.radius.min())
    moved = [now._replace(shifts=now.shifts + step * axis) for axis in np.eye(3)]
    return np.stack([(predicted(balls, other, rest) - before) / step for other in moved])


def _by_shared(balls: Balls, now: Fitted, names: list[str], before: F8, rest: F8 | None) -> F8:
    """Derivatives of the light `before` by the shared unknowns, G x K x N."""

    def light(name: str, other: Fitted) -> F8:
        return predicted(balls, other, rest if name in UNKNOWNS_OF_TOUCH_ALONE else None)

    return differences(now, names, UNKNOWNS_OF_FLAT_ALONE, before, light)


def _solve(e: _Equations, damping: float) -> tuple[F8, F8]:
    """The steps of the shared unknowns and of each ball, by Schur's complement."""
    damped = e.own * (1 + damping * np.eye(3))
    shared = e.shared + damping * np.diag(np.diag(e.shared) + 1e-12)
    schur, less = _without_shifts(shared, e.mixed, damped)
    solved = np.linalg.solve(damped, e.right_own[..., None])[..., 0]
    right = e.right - np.einsum("pgi,pi->g", e.mixed, solved)
    scale = np.sqrt(np.maximum(np.diag(schur), 1e-30))
    by = np.linalg.solve(schur / np.outer(scale, scale), right / scale) / scale
    return by, solved - np.einsum("pig,g->pi", less, by)


def _without_shifts(shared: F8, mixed: F8, by_shift: F8) -> tuple[F8, F8]:
    """Schur's complement of the balls' own blocks, and the shifts' coupling to the shared step."""
    less = np.linalg.solve(by_shift, np.transpose(mixed, (0, 2, 1)))
    return np.asarray(shared - np.einsum("pgi,pih->gh", mixed, less)), np.asarray(less)


def _covariance(e: _Equations) -> F8:
    """The covariance of the shared unknowns."""
    shared, _ = _without_shifts(e.shared, e.mixed, e.own)
    scale = np.sqrt(np.diag(shared))
    spread = np.linalg.pinv(shared / np.outer(scale, scale), hermitian=True)
    return np.asarray(spread / np.outer(scale, scale))


def start_at(lights: F4, strength: F4, count: int) -> Fitted:
    """Return a matt film under roughly known LEDs, as a start value."""
    emission = np.full(len(lights), EMISSION_UNKNOWN.start)
    unknowns = inverse_places(lights), np.log(np.maximum(strength, 1e-6)), emission
    leds = np.column_stack(unknowns).astype(np.float64)
    film = matt_film(lights.astype(np.float64))
    return Fitted(leds, film, np.zeros((count, 3)), LIGHT_DEVIATION).with_leds(leds)
