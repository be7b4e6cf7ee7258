"""Samples of balls pressed into a film, their light by equation F1, and normals from light."""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import DEVIATIONS_PER_MAD, F4, F8, Film, robust_deviation
from tactograph.nodes.calibrate import FOLD_COUNT, MAX_SAMPLE_SLOPE
from tactograph.nodes.calibrate.ball.ball_surface import ball_height, sunk
from tactograph.nodes.calibrate.lights.light_fit import HEIGHT_DEVIATION_MM, LedPlaces
from tactograph.nodes.calibrate.lights.light_samples import LIGHT_DEVIATION, Rest
from tactograph.nodes.optics.film import at_rest, predict, rest_below, rest_light, turned
from tactograph.nodes.optics.rest_shape import MIN_REST_LIGHT, rest_share

MIN_WEIGHT_LIGHT = 0.3
"""Light below which a sample's weight no longer grows."""
MAX_INDEPENDENT_SAMPLES = 1500
"""Most independent samples that the balls count as.  More have less noise, but a model's residuals
on a real film are correlated."""
FINAL_SAMPLES = 15000
"""Samples of the last fit, ten times as many as for the choice of parts.  With fewer, noise leaves
a ball's height, the coat's index and the albedo uncertain by some per cent."""
MAX_ROUNDS = 4
"""Most rounds in which what depends on one another is found in turn: harmonics or light from film
to film and the balls' positions, or a normal and the light about it."""
BALL_SECTORS = 8
"""Parts of a ball in azimuth over which errors of the normal are averaged, to suppress noise."""
BALL_RINGS = math.ceil(BALL_SECTORS / math.pi)
"""Parts in slant, so that parts are about as long as wide."""
BALL_PARTS = BALL_RINGS * BALL_SECTORS
"""Parts of a ball, and so the fewest samples that show all of it."""


@dataclass(frozen=True)
class Beneath:
    """The film at rest that N samples see, where it is no plane, and under the P balls' middles.

    `n` is 3 x N, `bounced` K x N the light from film to film for an albedo of 1; `base` is P.
    """

    n: F8
    x: F8
    y: F8
    z: F8
    bounced: F8
    base: F8

    def only(self, chosen: NDArray[np.bool_]) -> Self:
        """Return the film under some of the samples."""
        of_samples = "n", "x", "y", "z", "bounced"
        return replace(self, **{name: getattr(self, name)[..., chosen] for name in of_samples})

    def light(self, film: Film) -> F8:
        """Return r of equation F5, K x N: the film at rest over a plane."""
        return rest_share(film, self.n, self.x, self.y, self.z) + film.albedo * self.bounced


@dataclass(frozen=True)
class Balls:
    """Samples of P balls: N positions u, v (mm on the film at rest, as seen), light K x N.

    `ball` gives the ball of each sample, in order.  By ball: `centre` P x 2, contact radius
    `rim` and ball radius `radius`, all in mm.  `bounced` is the light from film to film on the
    samples for an albedo of 1.  Its derivatives per mm are `by_lift` (height of the ball) and
    `by_rim` (the film's rim).  `sector` numbers quarters of a ball.  `shift_mm` is the standard
    deviation of a ball's place, `width_mm` the width of film that the camera sees.  `beneath` is
    the film at rest if it is no plane.
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
    shift_mm: float
    width_mm: float
    beneath: Beneath | None = None

    @property
    def held_by(self) -> NDArray[np.intp]:
        """The unit for holding out samples: their ball, or the quarter of a single ball."""
        return self.ball if len(self.centre) > 1 else self.sector

    @property
    def reference_light(self) -> F8:
        """Light that residuals are relative to: that of the samples, or more."""
        return np.maximum(self.light, MIN_WEIGHT_LIGHT)

    def folds(self, some: "Balls | None" = None) -> list[NDArray[np.bool_]]:
        """Return which samples, or which of `some` of the same balls, are held out in turn."""
        numbers, held_by = np.unique(self.held_by % FOLD_COUNT), (some or self).held_by
        return [held_by % FOLD_COUNT == number for number in numbers]

    def only(self, chosen: NDArray[np.bool_]) -> Self:
        """Return some of the samples; balls without samples remain."""
        of_samples = "u", "v", "light", "ball", "bounced", "by_lift", "by_rim", "sector"
        some = {name: getattr(self, name)[..., chosen] for name in of_samples}
        beneath = None if self.beneath is None else self.beneath.only(chosen)
        return replace(self, **some, beneath=beneath)

    def thinned(self, most: int = MAX_INDEPENDENT_SAMPLES, *, last: bool = False) -> Self:
        """Return about `most` samples, evenly over each ball, but one or more for each part.

        For the last fit they are `FINAL_SAMPLES`.
        """
        each = max(BALL_PARTS, (FINAL_SAMPLES if last else most) // len(self.centre))
        first = np.searchsorted(self.ball, np.arange(len(self.centre) + 1))
        number = np.arange(self.ball.size) - first[self.ball]
        # A stride that does not divide the rows' length spreads the samples over all columns.
        return self.only(number % (np.diff(first)[self.ball] // each + 1) == 0)

    @property
    def place_deviations(self) -> F8:
        """Standard deviations of the balls' positions in x, y and z, P x 3.

        For a ball smaller than 1 mm in radius, that in z shrinks with the radius.
        """
        lift = HEIGHT_DEVIATION_MM * np.minimum(1, self.radius)
        return np.column_stack([np.full((len(lift), 2), self.shift_mm), lift])

    @property
    def pressed_slope(self) -> float:
        """The steepest slope of balls within their contacts, up to the steepest of a sample."""
        slant = math.asin(min(float((self.rim / self.radius)[self.ball].max()), 1))
        return min(math.tan(slant), MAX_SAMPLE_SLOPE)

    def departure(self, residual: F8) -> float:
        """Return the robust standard deviation of a sample's residual, relative to its light."""
        return float(robust_deviation(residual / self.reference_light))

    def scale(self, residual: F8) -> float:
        """Return that deviation, or that by which light departs by itself if it is more."""
        return max(LIGHT_DEVIATION, self.departure(residual))

    def grain(self, residual: F8, flat: F4, noise: F4) -> float:
        """Relative standard deviation of the light from the model, beyond the camera's noise.

        It counts where it is more than the noise, whose own size is not well known.
        """
        level = np.median(flat.reshape(len(flat), -1), axis=1)[:, None]
        camera = (noise[0] * level * self.light + noise[1]) / level**2
        variance = DEVIATIONS_PER_MAD**2 * np.median(np.square(residual / self.reference_light))
        alone = np.median(camera / self.reference_light**2)
        beyond = variance - alone
        return float(np.sqrt(beyond)) if beyond > alone else 0.0

    def sized(self, size: float) -> Self:
        """Return balls of `size` times the radius, in the same contacts."""
        if size == 1:
            return self
        radius = self.radius * size
        return replace(self, radius=radius, rim=np.minimum(self.rim, radius))

    def surface(self, shifts: F8, camera: float) -> tuple[F8, F8, F8, F8]:
        """Normals 3 x N and x, y, z where the camera's rays meet the balls, moved by `shifts`."""
        radius = self.radius[self.ball]
        cx, cy = (self.centre + shifts[:, :2])[self.ball].T
        low = shifts[:, 2] - sunk(self.radius, self.rim)
        cz = (low if self.beneath is None else low + self.beneath.base)[self.ball]
        z = ball_height(self.u, self.v, (cx, cy, cz), radius, camera)
        x, y = self.u * (1 - camera * z), self.v * (1 - camera * z)
        n = np.stack([x - cx, y - cy, z - cz]) / radius
        n[2] = np.maximum(n[2], 0.02)
        return n / np.sqrt((n * n).sum(0)), x, y, z

    def thrown(self, shifts: F8, film: Film) -> F8:
        """Light from film to film on the samples, K x N, with the balls moved by `shifts`."""
        whole = self.bounced + self.by_lift * shifts[self.ball, 2] + self.by_rim * film.rim
        return np.asarray(film.albedo * whole)

    def on_plane(self, light: F8, film: Film) -> F8:
        """Return light relative to the film at rest as that relative to a plane, K x N."""
        return light if self.beneath is None else light * self.beneath.light(film)

    def direct(self, shifts: F8, film: Film) -> F8:
        """The samples' light from the LEDs, K x N, relative to a plane."""
        return self.on_plane(self.light, film) - self.thrown(shifts, film)

    def touched_place(self, shifts: F8, film: Film) -> tuple[F8, tuple[F8, F8, F8], F8]:
        """Normals, places and lift for F1: film on a ball is touched, however low its rim is."""
        n, x, y, z = self.surface(shifts, film.camera)
        lift = np.maximum(z, film.contact)
        if self.beneath is None:
            return n, (x, y, lift), lift
        return n, (x, y, z), np.full_like(z, film.contact)

    def by_ball(self, left: F8, right: F8) -> F8:
        """Sum products over lights and a ball's samples: A x K x N, B x K x N to P x A x B."""
        ends = np.searchsorted(self.ball, np.arange(len(self.centre) + 1))
        return np.stack([summed(left[..., i:j], right[..., i:j]) for i, j in pairwise(ends)])


class BallNormals(NamedTuple):
    """True and found normals, 3 x N; the light without bounces, K x N; places, and their lift."""

    truth: F8
    fitted: F8
    direct: F8
    place: tuple[F8, F8, F8]
    lift: F8


class NormalError(NamedTuple):
    """The normals' root mean square error in degrees, and what noise alone leaves of it."""

    degrees: float
    noise: float


class Fitted(NamedTuple):
    """The LEDs (K x `LED_UNKNOWNS`), the film, the balls' shifts, and the residual scale.

    Shifts are P x 3 in mm.  The film's `lights` follow from `leds`.  `size` is the balls' radius
    over the given one, and `power` that to which the camera raises the light: nuisances, both 1
    unless they are fitted.
    """

    leds: F8
    film: Film
    shifts: F8
    scale: float = LIGHT_DEVIATION
    size: float = 1.0
    power: float = 1.0

    @classmethod
    def matt(cls, lights: F4, strength: F4, count: int) -> Self:
        """Return a matt film with `count` balls under roughly known LEDs, as a start value."""
        film = Film.matt(lights.astype(np.float64))
        unknowns = LedPlaces.of(lights).values, np.log(np.maximum(strength, 1e-6))
        leds = np.column_stack(unknowns).astype(np.float64)
        return cls(leds, film, np.zeros((count, 3))).with_leds(leds)

    def with_leds(self, leds: F8) -> Self:
        """Return a copy with other LEDs."""
        lights = cast(F4, LedPlaces(leds).positions)
        return self._replace(leds=leds, film=self.film._replace(lights=lights))

    def other_places(self, covariance: F8, width_mm: float) -> F4:
        """Return other places of the LEDs by their covariance, as `LedPlaces.sampled` does."""
        return LedPlaces(self.leds).sampled(covariance, width_mm)

    def predicted(self, balls: Balls, rest: F8 | None = None) -> F8:
        """Return the light of the balls' samples, K x N.

        `rest` is the result of `rest_view` for this film, or for one that is the same at rest.
        """
        film, shifts, balls = self.film, self.shifts, balls.sized(self.size)
        n, place, lift = balls.touched_place(shifts, film)
        light = predict(film, n, *place, rest, lift) + balls.thrown(shifts, film)
        if balls.beneath is not None:
            light = light / balls.beneath.light(film)
        return np.asarray(light if self.power == 1 else np.maximum(light, 0) ** self.power)

    def at_rest(self, rest: Rest) -> F8:
        """Return the logarithm of the light of the film at rest: K x M."""
        model = np.log(rest_light(self.film, rest.x, rest.y)) + self.leds[:, 3:4]
        if rest.beneath is not None:
            n, *place = rest.beneath
            light = rest_share(self.film, n, *place)
            if rest.bounced is not None:
                light = light + self.film.albedo * rest.bounced
            model += np.log(np.maximum(light, MIN_REST_LIGHT))
        model += rest.emitted(self.film)
        return np.asarray(model if self.power == 1 else model * self.power)

    def rest_residual(self, rest: Rest) -> F8:
        """Return the flat frame's logarithm minus `at_rest`, without the LEDs' common part."""
        model = self.at_rest(rest)
        return np.asarray(rest.logarithm - (model - model.mean(axis=0)))

    def left_at_rest(self, rest: Rest | None) -> float:
        """Return the root mean square of `rest_residual`; 0 without a flat frame."""
        return 0.0 if rest is None else math.sqrt(np.square(self.rest_residual(rest)).mean())

    def normals(self, balls: Balls, uneven: float = 0.0) -> BallNormals:
        """Find the normal of every sample from its light; `uneven` as in `Film`."""
        film = self.film
        truth, place, lift = balls.touched_place(self.shifts, film)
        direct = balls.direct(self.shifts, film)
        n, rest = truth, rest_below(film, *place)
        for _ in range(MAX_ROUNDS):
            n = turned(film, direct, n, place, uneven, rest, lift)
        return BallNormals(truth, n, direct, place, lift)

    def normal_error(self, balls: Balls) -> NormalError:
        """Return the error of the normals found from light.

        Noise is averaged over parts of each ball, as heights, which are sums of slopes, do.
        """
        truth, solved, *_ = self.normals(balls)
        part = _parts(balls, truth)
        number = np.maximum(np.bincount(part), 1)
        is_sampled, away = np.bincount(part) > 0, solved - truth
        mean = np.stack([np.bincount(part, e) / number for e in away])
        # Parts may hold a single sample, so all tell the noise of one.
        spread = np.square(away - mean[:, part]).sum() / max(part.size - is_sampled.sum(), 1)
        noise = spread * (1 / number)[is_sampled].mean()
        whole, least = np.degrees(np.sqrt([(mean * mean).sum(0)[is_sampled].mean(), noise]))
        return NormalError(float(whole), float(least))


def summed(left: F8, right: F8) -> F8:
    """Sum products over lights and samples: A x K x N, B x K x N to A x B."""
    return np.tensordot(left, right, ((1, 2), (1, 2)))


def rest_view(balls: Balls, film: Film) -> F8 | None:
    """The light of the film at rest where the pixels see it.

    None under a near camera, because the point that a pixel sees then depends on the ball.
    """
    return None if film.camera else at_rest(film, balls.u, balls.v)


def _parts(balls: Balls, normal: F8) -> NDArray[np.intp]:
    """The number of the ball's part in which each sample lies."""
    ring = np.minimum((BALL_RINGS * (1 - normal[2] ** 2)).astype(int), BALL_RINGS - 1)
    turn = np.arctan2(normal[1], normal[0]) / (2 * np.pi) % 1
    sector = (turn * BALL_SECTORS).astype(int) % BALL_SECTORS
    return np.asarray((balls.ball * BALL_RINGS + ring) * BALL_SECTORS + sector, np.intp)
