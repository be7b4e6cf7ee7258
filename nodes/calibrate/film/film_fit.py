"""Film, LEDs and camera together: a least-squares fit of equation F1 to balls and the flat frame.

The unknowns are each LED's direction, distance, strength, emission and diffuse share; shared
parameters (gain, coat, albedo, rim, pupil); and a shift of every ball.  Balls are coupled only by
the shared unknowns, so the shifts are eliminated ball by ball (Schur's complement), for one ball
as for a hundred.

Long because the equations, their elimination and their priors share the same unknowns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, USUAL_RIM_MM, Film
from tactograph.nodes.calibrate.lights.light_fit import (
    HEIGHT_DEVIATION_MM,
    HUBER_DEVIATIONS,
    INFINITY_MM,
    LIGHT_DEVIATION,
    Rest,
    huber,
    places_within,
)
from tactograph.nodes.optics.film import (
    FADE,
    GRAZING,
    at_rest,
    matt_film,
    place_terms,
    predict,
    rest_light,
    shades,
)

F8 = NDArray[np.float64]

MIN_WEIGHT_LIGHT = 0.3
"""Light below which a sample's weight no longer grows."""
MAX_STEPS, MIN_COST_GAIN = 20, 2e-3
"""Most steps of the descent, and the relative gain of the cost below which it ends."""
MAX_INDEPENDENT_REST = 20
"""Most independent values per LED that the flat frame counts as where it departs from the model,
because its departures are smooth."""
MAX_INDEPENDENT_SAMPLES = 1500
"""Most independent samples that the balls count as.  More have less noise, but a model's residuals
on a real film are correlated."""
HEIGHT_DEVIATION_SHARE = 0.2
"""Standard deviation of a ball's height in the film, as a share of its radius."""
RIDGE_SHARE = 1e-3
"""Ridge of the harmonics' coefficients, relative to the mean square of a sample."""
HARMONICS_ROUNDS = 4
"""Rounds in which harmonics and the balls' positions are found in turn."""


class Unknown(NamedTuple):
    """A shared parameter: start value, standard deviation, bounds, and step for derivatives."""

    start: float
    spread: float
    low: float
    high: float
    step: float = 1e-4


SHARED_UNKNOWNS = {
    "gain": Unknown(1.0, 0.1, 0.8, 1.3),
    "base": Unknown(0.5, 0.3, 0.05, 5.0, 1e-3),
    "roughness": Unknown(0.25, 0.15, 0.08, 0.6, 1e-3),
    "refraction": Unknown(1.5, 0.05, 1.3, 1.6, 1e-3),
    "albedo": Unknown(0.5, 0.4, 0.0, 0.95, 1e-3),
    "rim": Unknown(USUAL_RIM_MM, 1.0, 0.0, 10.0, 1e-2),
    "camera": Unknown(0.0, 0.01, 0.0, 0.05, 1e-5),
}
DIFFUSE_UNKNOWN = Unknown(0.2, 0.3, 0.0, 0.9)
ALBEDO_DIFFERENCE = {"base": 1, "albedo": -1}
"""The albedo under the coat equals that for light from film to film: they differ by 0, ..."""
ALBEDO_DEVIATION = 0.002
"""... with this standard deviation.  Alone, the albedo under a coat nearly trades off against the
coat's index."""
EMISSION_UNKNOWN = Unknown(0.0, 0.7, -1.0, 4.0, 1e-3)
"""m: an LED that faces the middle of the film emits as cos^m of the angle from its axis.  It is
fitted to the flat frame only: ignoring it would give a wrong distance there, while touched film,
relative to the flat frame, hardly depends on it."""
LED_UNKNOWNS = "x", "y", "nearness", "strength", "emission"
UNKNOWNS_PER_LED = len(LED_UNKNOWNS)
"""Number of unknowns of an LED."""
UNKNOWNS_OF_FLAT_ALONE = "strength", "emission"
"""Unknowns without effect on the light of touched film relative to the film at rest."""
UNKNOWNS_OF_TOUCH_ALONE = "gain", "diffuse", "albedo", "rim"
"""Unknowns without effect on the film at rest."""
PARTS = {
    "diffuse": ("diffuse", "gain"),
    "lobe": ("base", "roughness", "refraction"),
    "bounce": ("albedo", "rim"),
    "camera": ("camera",),
}
"""The unknowns of each part of the model."""


@dataclass(frozen=True)
class Balls:
    """Samples of P balls: N positions u, v (mm on the film at rest, as seen), light K x N.

    `ball` gives the ball of each sample, in order.  By ball: `centre` P x 2, contact radius
    `rim` and ball radius `radius`, all in mm.  `bounced` is the light from film to film on the
    samples for an albedo of 1.  Its derivatives per mm are `by_lift` (height of the ball) and
    `by_rim` (the film's rim).  `sector` numbers slices of a ball.
    """

    u: F8
    v: F8
    light: F8
    ball: NDArray[np.intp]
    centre: F8
    rim: F8
    radius: F8
    bounced: F8
    by_lift: F8
    by_rim: F8
    sector: NDArray[np.intp]

    @property
    def held_by(self) -> NDArray[np.intp]:
        """The unit for holding out samples: their ball, or the slice of a single ball."""
        return self.ball if len(self.centre) > 1 else self.sector

    def only(self, chosen: NDArray[np.bool_]) -> Balls:
        """Return some of the samples; balls without samples remain."""
        return replace(
            self,
            u=self.u[chosen],
            v=self.v[chosen],
            light=self.light[:, chosen],
            ball=self.ball[chosen],
            bounced=self.bounced[:, chosen],
            by_lift=self.by_lift[:, chosen],
            by_rim=self.by_rim[:, chosen],
            sector=self.sector[chosen],
        )

    def seen(self, shifts: F8, camera: float) -> tuple[F8, F8, F8, F8]:
        """Normals 3 x N and x, y, z where the camera's rays meet the balls, moved by `shifts`."""
        radius = self.radius[self.ball]
        cx, cy = (self.centre + shifts[:, :2])[self.ball].T
        cz = (shifts[:, 2] - sunk(self.radius, self.rim))[self.ball]
        z = ball_height(self.u, self.v, (cx, cy, cz), radius, camera)
        x, y = self.u * (1 - camera * z), self.v * (1 - camera * z)
        n = np.stack([x - cx, y - cy, z - cz]) / radius
        n[2] = np.maximum(n[2], 0.02)
        return n / np.sqrt((n * n).sum(0)), x, y, z

    def thrown(self, shifts: F8, film: Film) -> F8:
        """Light from film to film on the samples, K x N, with the balls moved by `shifts`."""
        whole = self.bounced + self.by_lift * shifts[self.ball, 2] + self.by_rim * film.rim
        return np.asarray(film.albedo * whole)

    def by_ball(self, left: F8, right: F8) -> F8:
        """Sum products over lights and a ball's samples: A x K x N, B x K x N to P x A x B."""
        ends = np.searchsorted(self.ball, np.arange(len(self.centre) + 1))
        return np.stack(
            [
                left[..., i:j].reshape(len(left), -1) @ right[..., i:j].reshape(len(right), -1).T
                for i, j in pairwise(ends)
            ]
        )


def sunk(radius: Any, rim: Any) -> F8:
    """Return the depth of balls' centres below the film at rest, from their contact radii."""
    return np.asarray(np.sqrt(np.maximum(radius**2 - rim**2, 0)))


def ball_height(u: F8, v: F8, centre: tuple[Any, Any, Any], radius: Any, camera: float) -> F8:
    """Return the height in mm at which the ray through u, v on the film at rest meets a ball.

    If the ray misses the ball, it is the height where the ray comes closest.
    """
    cx, cy, cz = centre
    du, dv = u - cx, v - cy
    a = 1 + camera**2 * (u**2 + v**2)
    b = camera * (u * du + v * dv) + cz
    c = du * du + dv * dv + cz * cz - radius**2
    return np.asarray((b + np.sqrt(np.maximum(b * b - a * c, 0))) / a)


class Fitted(NamedTuple):
    """The LEDs' unknowns K x UNKNOWNS_PER_LED, the film, the balls' shifts, and the residual scale.

    Shifts are P x 3 in mm.  The film's `lights` follow from `leds`.
    """

    leds: F8
    film: Film
    shifts: F8
    scale: float

    def with_leds(self, leds: F8) -> Fitted:
        """Return a copy with other LEDs."""
        ends = np.column_stack([leds[:, :2], np.ones(len(leds))])
        lights = ends / np.maximum(leds[:, 2:3], 1 / INFINITY_MM)
        return self._replace(leds=leds, film=self.film._replace(lights=cast(F4, lights)))


class _Problem(NamedTuple):
    """The data of the fit, the free parameters, and the standard deviations.

    `scale` is the standard deviation of a sample, `certain` that of a block of the flat frame.
    """

    balls: Balls
    rest: Rest | None
    names: list[str]
    shift_mm: float
    width_mm: float
    scale: float = LIGHT_DEVIATION
    certain: float = LIGHT_DEVIATION

    @property
    def each(self) -> float:
        """Weight of a sample."""
        return min(1, MAX_INDEPENDENT_SAMPLES / max(self.balls.u.size, 1))

    def judged(self, now: Fitted) -> _Problem:
        """Return the problem with the standard deviations of the residuals of `now`."""
        certain = LIGHT_DEVIATION
        if self.rest is not None:
            certain = _rest_spread(rest_left(self.rest, now), self.rest)
        return self._replace(scale=_scale(self.balls, now), certain=certain)


class _Equations(NamedTuple):
    """Normal equations: shared G x G, mixed P x G x 3, own P x 3 x 3, and right-hand sides."""

    shared: F8
    mixed: F8
    own: F8
    right: F8
    right_own: F8


def predicted(balls: Balls, fitted: Fitted, led: int | None = None, rest: F8 | None = None) -> F8:
    """Return the light of the balls' samples, K x N, or 1 x N for one LED.

    `rest` is the result of `_rest_seen` for this film, or for one that is the same at rest.
    """
    film, thrown = fitted.film, balls.thrown(fitted.shifts, fitted.film)
    if led is not None:
        one = slice(led, led + 1)
        film = film._replace(
            lights=film.lights[one], diffuse=film.diffuse[one], harmonics=film.harmonics[one]
        )
        thrown, rest = thrown[one], None if rest is None else rest[one]
    n, x, y, z = balls.seen(fitted.shifts, film.camera)
    made = predict(film, n, x, y, _touched(z, film), rest)
    return np.asarray(made + thrown)


def _rest_seen(balls: Balls, film: Film) -> F8 | None:
    """The light of the film at rest where the pixels see it.

    None under a near camera, because the point that a pixel sees then depends on the ball.
    """
    return None if film.camera else at_rest(film, balls.u, balls.v)


def _touched(z: F8, film: Film) -> F8:
    """Heights of at least `film.contact`: the film on a ball is touched, however low its rim is."""
    return np.maximum(z, film.contact)


def fit(
    balls: Balls,
    rest: Rest | None,
    parts: frozenset[str],
    start: Fitted,
    shift_mm: float,
    width_mm: float,
) -> Fitted:
    """Return the best film, LEDs and shifts, by a robust Levenberg-Marquardt descent.

    Parameters
    ----------
    balls
        The samples.
    rest
        The flat frame in blocks, if there is one.
    parts
        Which of `PARTS` are fitted; all other parameters stay as in `start`.
    start
        Start values of the descent.
    shift_mm
        Standard deviation of a ball's position.
    width_mm
        Width of the film that the camera sees.
    """
    names = [name for part in sorted(parts) for name in PARTS[part]]
    now, damping = _opened(start, names), 1e-3
    problem = _Problem(balls, rest, names, shift_mm, width_mm).judged(now)
    cost = _cost(problem, now)
    for _ in range(MAX_STEPS):
        equations = _equations(problem, now)
        while damping < 1e8:
            trial = _moved(now, names, *_solve(equations, damping))
            tried = _cost(problem, trial)
            if tried < cost:
                break
            damping *= 10
        else:
            break
        gain, now, damping = cost - tried, trial, max(damping / 10, 1e-9)
        if gain < MIN_COST_GAIN * cost:
            break
        problem = problem.judged(now)
        cost = _cost(problem, now)
    return now._replace(scale=problem.scale)


def other_places(
    balls: Balls,
    rest: Rest | None,
    parts: frozenset[str],
    fitted: Fitted,
    shift_mm: float,
    width_mm: float,
) -> F4:
    """Return LED positions sampled from the uncertainty of the fit, 8 x K x 3 in mm.

    The uncertainty accounts for all other free parameters, such as coat and albedo.
    """
    names = [name for part in sorted(parts) for name in PARTS[part]]
    problem = _Problem(balls, rest, names, shift_mm, width_mm).judged(fitted)
    left = _weighted(balls, predicted(balls, fitted) - balls.light)
    known = _equations(problem._replace(scale=_robust_spread(left)), fitted)
    shared, _ = _without_shifts(known.shared, known.mixed, known.own)
    scale = np.sqrt(np.diag(shared))
    spread = np.linalg.pinv(shared / np.outer(scale, scale), hermitian=True)
    spread /= np.outer(scale, scale)
    places = [UNKNOWNS_PER_LED * k + j for k in range(len(fitted.leds)) for j in range(3)]
    return places_within(fitted.leds[:, :3], spread[np.ix_(places, places)], width_mm)


def place_balls(balls: Balls, fitted: Fitted, shift_mm: float) -> Fitted:
    """Return `fitted` with the balls placed under its known film."""
    now, scale = fitted, fitted.scale
    spread, rest = _spread(balls, shift_mm), _rest_seen(balls, fitted.film)
    for _ in range(10):
        left, by = _by_shift(balls, now, rest)
        weight = (
            _robust(_weighted(balls, left) / scale)
            / (scale * np.maximum(balls.light, MIN_WEIGHT_LIGHT)) ** 2
        )
        normal = balls.by_ball(by * weight, by) + _diagonals(spread**-2)
        right = -balls.by_ball(by, (weight * left)[None])[..., 0] - now.shifts * spread**-2
        step = np.clip(np.linalg.solve(normal, right[..., None])[..., 0], -spread, spread)
        now = now._replace(shifts=now.shifts + step)
        if np.abs(step[:, :2]).max() < 1e-3 * shift_mm:
            break
    return now


def _spread(balls: Balls, shift_mm: float) -> F8:
    """Standard deviations of the balls' positions in x, y and z, P x 3."""
    lift = np.minimum(HEIGHT_DEVIATION_MM, HEIGHT_DEVIATION_SHARE * balls.radius)
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
    used = (degree + 1) * (degree + 2) // 2
    count, size, now = len(fitted.leds), 8 * used, fitted
    n, *_ = balls.seen(now.shifts, now.film.camera)
    film = fitted.film._replace(flattest=float(np.quantile(n[2], 0.005)), reach=reach)
    physics = fitted._replace(film=film)
    place = place_terms(balls.u / reach, balls.v / reach)[:used]
    weight = 1 / np.maximum(balls.light, MIN_WEIGHT_LIGHT) ** 2
    held = np.full(count * size + 1, RIDGE_SHARE * balls.u.size)
    held[-1] = 0
    for _ in range(HARMONICS_ROUNDS):
        n, *_ = balls.seen(now.shifts, film.camera)
        shade = shades(n) * np.clip(1 + (n[2] - film.flattest) / FADE, 0, 1)
        basis = (shade[:, None] * place[None]).reshape(size, -1)
        thrown = balls.thrown(now.shifts, film)
        base = predicted(balls, physics._replace(shifts=now.shifts)) - thrown
        left = balls.light - base - thrown
        normal, right = np.diag(held), np.zeros(count * size + 1)
        for k in range(count):
            own, weighted = slice(k * size, (k + 1) * size), basis * weight[k]
            normal[own, own] += weighted @ basis.T
            normal[own, -1] = normal[-1, own] = weighted @ base[k]
            right[own] = weighted @ left[k]
            normal[-1, -1] += (weight[k] * base[k]) @ base[k]
            right[-1] += (weight[k] * base[k]) @ left[k]
        change = np.linalg.solve(normal, right)
        harmonics = np.zeros((count, 8, 6))
        harmonics[:, :, :used] = change[:-1].reshape(count, 8, used)
        gain = film.gain * (1 + float(change[-1]))
        now = now._replace(film=film._replace(harmonics=cast(F4, harmonics), gain=gain))
        now = place_balls(balls, now._replace(scale=_scale(balls, now)), shift_mm)
        weight = _cauchy(_weighted(balls, balls.light - predicted(balls, now)), now.scale)
        weight = weight / np.maximum(balls.light, MIN_WEIGHT_LIGHT) ** 2
    return now._replace(scale=_scale(balls, now))


def _cauchy(left: F8, scale: float) -> F8:
    return np.asarray(1 / (1 + (left / (3 * scale)) ** 2))


def _opened(start: Fitted, names: list[str]) -> Fitted:
    """Move newly freed parameters away from the values that switch them off."""
    off = matt_film(start.film.lights)
    changed: dict[str, Any] = {
        name: SHARED_UNKNOWNS[name].start
        for name in names
        if name in SHARED_UNKNOWNS and getattr(start.film, name) == getattr(off, name)
    }
    if "diffuse" in names and not start.film.diffuse.any():
        changed["diffuse"] = np.full(len(start.leds), DIFFUSE_UNKNOWN.start)
    return start._replace(film=start.film._replace(**changed))


def _weighted(balls: Balls, left: F8) -> F8:
    return np.asarray(left / np.maximum(balls.light, MIN_WEIGHT_LIGHT))


def _scale(balls: Balls, now: Fitted) -> float:
    """Robust standard deviation of a sample's residual."""
    return max(
        LIGHT_DEVIATION, _robust_spread(_weighted(balls, predicted(balls, now) - balls.light))
    )


def _robust_spread(left: F8) -> float:
    return 1.4826 * float(np.median(np.abs(left)))


def _robust(left: F8) -> F8:
    """Huber's weights."""
    return np.asarray(np.minimum(1, HUBER_DEVIATIONS / np.maximum(np.abs(left), HUBER_DEVIATIONS)))


def rest_left(rest: Rest, now: Fitted) -> F8:
    """Logarithm of the flat frame minus the model's, without what all LEDs share: K x M."""
    return _rest_less(rest, _rest_model(rest, now))


def _rest_less(rest: Rest, model: F8) -> F8:
    return np.asarray(rest.logarithm - (model - model.mean(axis=0)))


def _rest_model(rest: Rest, now: Fitted, chosen: slice = slice(None)) -> F8:
    """Logarithm of the light of the film at rest under the chosen LEDs: K x M."""
    film, leds = now.film._replace(lights=now.film.lights[chosen]), now.leds[chosen]
    model = np.log(rest_light(film, rest.x, rest.y)) + leds[:, 3:4]
    return np.asarray(model + leds[:, 4:] * np.log(_off_axis(film, rest.x, rest.y)))


def _by_rest(rest: Rest, now: Fitted, names: list[str]) -> F8:
    """Derivatives of `rest_left` by the shared unknowns: G x K x M."""
    model, owners = _rest_model(rest, now), _owners(now, names)
    before, by = _rest_less(rest, model), np.zeros((len(owners), *model.shape))
    for j, (name, led) in enumerate(owners):
        if name in UNKNOWNS_OF_TOUCH_ALONE:
            continue
        other, step = _stepped(now, names, j)
        chosen = slice(None) if led is None else slice(led, led + 1)
        changed = model.copy()
        changed[chosen] = _rest_model(rest, other, chosen)
        by[j] = (_rest_less(rest, changed) - before) / step
    return by


def _off_axis(film: Film, x: F8, y: F8) -> F8:
    """Cosines of emission from LEDs that face the middle of the film: K x M."""
    lx, ly, lz = film.lights.T[..., None].astype(np.float64)
    high = np.sqrt(lx * lx + ly * ly + lz * lz)
    away = np.sqrt((lx - x) ** 2 + (ly - y) ** 2 + lz * lz)
    return np.asarray(np.maximum((high * high - lx * x - ly * y) / (high * away), GRAZING))


def _rest_spread(left: F8, rest: Rest) -> float:
    """Standard deviation of a block; larger if the flat frame (smoothly) departs from the model."""
    noise = LIGHT_DEVIATION / rest.block
    residual = float(np.sqrt(np.square(left).mean()))
    return float(np.hypot(noise, residual * np.sqrt(max(1, left.shape[1] / MAX_INDEPENDENT_REST))))


def _priors(now: Fitted, names: list[str], width_mm: float) -> Iterator[tuple[int, float, float]]:
    """Number, departure and standard deviation of every unknown with a prior."""
    count = len(now.leds)
    for k, (_, _, c, _, emission) in enumerate(now.leds):
        yield UNKNOWNS_PER_LED * k + 2, c - 0.2 / width_mm, 0.2 / width_mm
        yield UNKNOWNS_PER_LED * k + 4, emission - EMISSION_UNKNOWN.start, EMISSION_UNKNOWN.spread
    for number, (_, value, about) in _numbers(now, names):
        yield UNKNOWNS_PER_LED * count + number, value - about.start, about.spread


def _numbers(now: Fitted, names: list[str]) -> Iterator[tuple[int, tuple[str, float, Unknown]]]:
    """The film's unknowns, in order."""
    number = 0
    for name in names:
        if name == "diffuse":
            for share in now.film.diffuse:
                yield number, (name, float(share), DIFFUSE_UNKNOWN)
                number += 1
        else:
            yield number, (name, float(getattr(now.film, name)), SHARED_UNKNOWNS[name])
            number += 1


def _albedos(now: Fitted, names: list[str]) -> Iterator[tuple[float, F8]]:
    """Normalised difference of the two albedos, and its derivatives by all shared unknowns."""
    if not ALBEDO_DIFFERENCE.keys() <= set(names):
        return
    numbers = [(number, name) for number, (name, *_) in _numbers(now, names)]
    by = np.zeros(now.leds.size + len(numbers))
    for number, name in numbers:
        by[now.leds.size + number] = ALBEDO_DIFFERENCE.get(name, 0) / ALBEDO_DEVIATION
    yield (now.film.base - now.film.albedo) / ALBEDO_DEVIATION, by


def _cost(problem: _Problem, now: Fitted) -> float:
    balls, rest, names, shift_mm, width_mm, scale, certain = problem
    total = float(np.square(now.shifts / _spread(balls, shift_mm)).sum())
    left = _weighted(balls, predicted(balls, now) - balls.light)
    total += problem.each * huber(left / scale)
    if rest is not None:
        total += huber(rest_left(rest, now) / certain)
    total += float(now.leds[:, 3].mean() ** 2)
    total += sum(away**2 for away, _ in _albedos(now, names))
    return total + sum((away / sure) ** 2 for _, away, sure in _priors(now, names, width_mm))


def _equations(problem: _Problem, now: Fitted) -> _Equations:
    balls, rest, names, shift_mm, width_mm, scale, certain = problem
    seen = _rest_seen(balls, now.film)
    left, by_own = _by_shift(balls, now, seen)
    by = _by_shared(balls, now, names, left + balls.light, seen)
    weight = (
        _robust(_weighted(balls, left) / scale)
        / (scale * np.maximum(balls.light, MIN_WEIGHT_LIGHT)) ** 2
    )
    weight *= problem.each
    spread = _spread(balls, shift_mm)
    sure, away = by * weight, (weight * left)[None]
    shared = sure.reshape(len(by), -1) @ by.reshape(len(by), -1).T
    right = -(by.reshape(len(by), -1) @ away.ravel())
    mixed = balls.by_ball(sure, by_own)
    own = balls.by_ball(by_own * weight, by_own) + _diagonals(spread**-2)
    right_own = -balls.by_ball(by_own, away)[..., 0] - now.shifts * spread**-2
    if rest is not None:
        there, by_rest = rest_left(rest, now), _by_rest(rest, now, names)
        flat, firm = by_rest.reshape(len(by), -1), (_robust(there / certain) / certain**2).ravel()
        shared += (flat * firm) @ flat.T
        right -= flat @ (firm * there.ravel())
    # The flat frame leaves the strengths' common factor free; without one, all of them are free.
    # So a prior holds them.
    strengths = np.arange(3, now.leds.size, UNKNOWNS_PER_LED)
    held = 1 / len(strengths) ** 2 if rest is not None else np.eye(len(strengths))
    shared[np.ix_(strengths, strengths)] += held
    right[strengths] -= now.leds[:, 3].mean() / len(strengths)
    for j, away_from, sure_of in _priors(now, names, width_mm):
        shared[j, j] += sure_of**-2
        right[j] -= away_from / sure_of**2
    for away_from, by_all in _albedos(now, names):
        shared += np.outer(by_all, by_all)
        right -= by_all * away_from
    return _Equations(shared, mixed, own, right, right_own)


def _by_shift(balls: Balls, now: Fitted, rest: F8 | None) -> tuple[F8, F8]:
    """Residual of the light, K x N, and its derivatives by the balls' shifts, 3 x K x N.

    `rest` is the result of `_rest_seen`.
    """
    before, step = predicted(balls, now, rest=rest), 1e-4 * float(balls.radius.min())
    moved = [now._replace(shifts=now.shifts + step * axis) for axis in np.eye(3)]
    by = [(predicted(balls, other, rest=rest) - before) / step for other in moved]
    return before - balls.light, np.stack(by)


def _by_shared(balls: Balls, now: Fitted, names: list[str], before: F8, rest: F8 | None) -> F8:
    """Derivatives by the shared unknowns, G x K x N; an LED's own only change its own light."""
    owners = _owners(now, names)
    by = np.zeros((len(owners), *before.shape))
    for j, (name, led) in enumerate(owners):
        if name in UNKNOWNS_OF_FLAT_ALONE:
            continue
        other, step = _stepped(now, names, j)
        known = rest if name in UNKNOWNS_OF_TOUCH_ALONE else None
        if led is None:
            by[j] = (predicted(balls, other, rest=known) - before) / step
        else:
            by[j, led] = (predicted(balls, other, led, known)[0] - before[led]) / step
    return by


def _owners(now: Fitted, names: list[str]) -> list[tuple[str, int | None]]:
    """Name of each shared unknown, and the LED that it belongs to, or None."""
    count = len(now.leds)
    owners: list[tuple[str, int | None]] = [
        (name, k) for k in range(count) for name in LED_UNKNOWNS
    ]
    for name in names:
        owners += [(name, k) for k in range(count)] if name == "diffuse" else [(name, None)]
    return owners


def _stepped(now: Fitted, names: list[str], j: int) -> tuple[Fitted, float]:
    """The fit with one unknown changed, and its change."""
    count = len(now.leds)
    if j < UNKNOWNS_PER_LED * count:
        change = np.zeros(UNKNOWNS_PER_LED * count)
        change[j] = step = 1e-5 * (
            1 if j % UNKNOWNS_PER_LED != 2 else max(now.leds[j // UNKNOWNS_PER_LED, 2], 1e-4)
        )
        return now.with_leds(now.leds + change.reshape(-1, UNKNOWNS_PER_LED)), step
    steps = np.zeros(sum(1 for _ in _numbers(now, names)))
    about = dict(_numbers(now, names))[j - UNKNOWNS_PER_LED * count][2]
    steps[j - UNKNOWNS_PER_LED * count] = about.step
    return now._replace(film=_film_moved(now.film, names, steps, bounded=False)), about.step


def _film_moved(film: Film, names: list[str], by: F8, bounded: bool = True) -> Film:
    changed: dict[str, Any] = {}
    number = 0
    for name in names:
        size = len(film.diffuse) if name == "diffuse" else 1
        about = DIFFUSE_UNKNOWN if name == "diffuse" else SHARED_UNKNOWNS[name]
        value = getattr(film, name) + by[number : number + size]
        value = np.clip(value, about.low, about.high) if bounded else value
        changed[name] = value if name == "diffuse" else float(value[0])
        number += size
    return film._replace(**changed)


def _moved(now: Fitted, names: list[str], by: F8, own: F8) -> Fitted:
    count = len(now.leds)
    leds = now.leds + by[: UNKNOWNS_PER_LED * count].reshape(-1, UNKNOWNS_PER_LED)
    leds[:, 2] = np.maximum(leds[:, 2], 1 / INFINITY_MM)
    leds[:, 4] = np.clip(leds[:, 4], EMISSION_UNKNOWN.low, EMISSION_UNKNOWN.high)
    film = _film_moved(now.film, names, by[UNKNOWNS_PER_LED * count :])
    return now._replace(film=film, shifts=now.shifts + own).with_leds(leds)


def _solve(e: _Equations, damping: float) -> tuple[F8, F8]:
    """The steps of the shared unknowns and of each ball, by Schur's complement."""
    own = e.own * (1 + damping * np.eye(3))
    shared = e.shared + damping * np.diag(np.diag(e.shared) + 1e-12)
    schur, less = _without_shifts(shared, e.mixed, own)
    solved = np.linalg.solve(own, e.right_own[..., None])[..., 0]
    right = e.right - np.einsum("pgi,pi->g", e.mixed, solved)
    scale = np.sqrt(np.maximum(np.diag(schur), 1e-30))
    by = np.linalg.solve(schur / np.outer(scale, scale), right / scale) / scale
    return by, solved - np.einsum("pig,g->pi", less, by)


def _without_shifts(shared: F8, mixed: F8, own: F8) -> tuple[F8, F8]:
    """Schur's complement of the balls' own blocks, and the shifts' coupling to the shared step."""
    less = np.linalg.solve(own, np.transpose(mixed, (0, 2, 1)))
    return np.asarray(shared - np.einsum("pgi,pih->gh", mixed, less)), np.asarray(less)


def start_at(lights: F4, strength: F4, count: int) -> Fitted:
    """Return a matt film under roughly known LEDs, as a start value."""
    leds = np.column_stack(
        [
            lights[:, :2] / lights[:, 2:],
            1 / np.minimum(lights[:, 2], INFINITY_MM),
            np.log(np.maximum(strength, 1e-6)),
            np.full(len(lights), EMISSION_UNKNOWN.start),
        ]
    ).astype(np.float64)
    film = matt_film(lights.astype(np.float64))
    return Fitted(leds, film, np.zeros((count, 3)), LIGHT_DEVIATION).with_leds(leds)
