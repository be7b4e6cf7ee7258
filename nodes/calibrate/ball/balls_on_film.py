"""Samples of balls pressed into a film, and their light by equation F1."""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import DEVIATIONS_PER_MAD, F4, F8, Film
from tactograph.nodes.calibrate import MAX_SAMPLE_SLOPE
from tactograph.nodes.calibrate.ball.ball_surface import ball_height, sunk
from tactograph.nodes.calibrate.lights.light_fit import (
    HEIGHT_DEVIATION_MM,
    LIGHT_DEVIATION,
    positions,
)
from tactograph.nodes.optics.film import at_rest, predict
from tactograph.nodes.optics.rest_shape import rest_share

MIN_WEIGHT_LIGHT = 0.3
"""Light below which a sample's weight no longer grows."""
MAX_INDEPENDENT_SAMPLES = 1500
"""Most independent samples that the balls count as.  More have less noise, but a model's residuals
on a real film are correlated."""
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

    def only(self, chosen: NDArray[np.bool_]) -> Self:
        """Return some of the samples; balls without samples remain."""
        of_samples = "u", "v", "light", "ball", "bounced", "by_lift", "by_rim", "sector"
        some = {name: getattr(self, name)[..., chosen] for name in of_samples}
        beneath = None if self.beneath is None else self.beneath.only(chosen)
        return replace(self, **some, beneath=beneath)

    def thinned(self, most: int = MAX_INDEPENDENT_SAMPLES) -> Self:
        """Return about `most` samples, evenly over each ball, but one or more for each part."""
        each = max(BALL_PARTS, most // len(self.centre))
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

    def scale(self, residual: F8) -> float:
        """Return the robust standard deviation of a sample's residual."""
        spread = DEVIATIONS_PER_MAD * float(np.median(np.abs(residual / self.reference_light)))
        return max(LIGHT_DEVIATION, spread)

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


class Fitted(NamedTuple):
    """The LEDs (K x `LED_UNKNOWNS`), the film, the balls' shifts, and the residual scale.

    Shifts are P x 3 in mm.  The film's `lights` follow from `leds`.  `size` is the balls' radius
    over the given one, and `power` that to which the camera raises the light: nuisances, both 1
    unless they are fitted.
    """

    leds: F8
    film: Film
    shifts: F8
    scale: float
    size: float = 1.0
    power: float = 1.0

    def with_leds(self, leds: F8) -> Self:
        """Return a copy with other LEDs."""
        lights = cast(F4, positions(leds))
        film = self.film._replace(lights=lights, emission=float(leds[:, 4].mean()))
        return self._replace(leds=leds, film=film)


def summed(left: F8, right: F8) -> F8:
    """Sum products over lights and samples: A x K x N, B x K x N to A x B."""
    return np.tensordot(left, right, ((1, 2), (1, 2)))


def predicted(balls: Balls, fitted: Fitted, rest: F8 | None = None) -> F8:
    """Return the light of the balls' samples, K x N.

    `rest` is the result of `rest_view` for this film, or for one that is the same at rest.
    """
    film, shifts, balls = fitted.film, fitted.shifts, balls.sized(fitted.size)
    n, place, lift = balls.touched_place(shifts, film)
    light = predict(film, n, *place, rest, lift) + balls.thrown(shifts, film)
    if balls.beneath is not None:
        light = light / balls.beneath.light(film)
    return np.asarray(light if fitted.power == 1 else np.maximum(light, 0) ** fitted.power)


def rest_view(balls: Balls, film: Film) -> F8 | None:
    """The light of the film at rest where the pixels see it.

    None under a near camera, because the point that a pixel sees then depends on the ball.
    """
    return None if film.camera else at_rest(film, balls.u, balls.v)
