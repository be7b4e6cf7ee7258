"""Errors of a film's model on held-out presses, and their correlation length."""

from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fftfreq, irfft2, next_fast_len, rfft2
from scipy.optimize import isotonic_regression
from scipy.special import ndtr, stdtrit

from tactograph.nodes import BAND_DEVIATIONS, F4, F8, FULL_MISFIT_SLOPE, Film
from tactograph.nodes.calibrate import MIN_BOUNCE_ERROR
from tactograph.nodes.calibrate.ball.balls_on_film import MIN_WEIGHT_LIGHT, Balls, Fitted
from tactograph.nodes.calibrate.lights.light_fit import LedPlaces
from tactograph.nodes.light.touch_misfit import brighter
from tactograph.nodes.optics.film import direct_share, predict, touch_gain, turned

MIN_LAG_PX = 2
"""Distance from which the noise of pixels is independent, even after undistortion."""
BRIGHTENING_FACTOR = 2.5
"""Factor by which another object may brighten the film more than the calibration's balls, which
all stretch it in the same way."""


class Held(NamedTuple):
    """Every held-out pixel, fold by fold, with the film fitted to the others; mm per px."""

    folds: list[tuple[Balls, Fitted]]
    pixel: float

    def misfit(self, film: Film, uneven: float) -> F4:
        """Return the (level, width, light, bounce, tilt) of a `Misfit`.

        Products of the errors of two pixels contain no noise, because noise is independent.  Their
        mean by distance is the covariance of the model's errors.  The common tilt of all normals of
        a ball is removed first and measured separately.  Level and width include what chance may
        have hidden, which is the less the farther pixels are apart, because more pairs are.  All
        figures are for one further press: the finite number n of presses adds 1/n to the variance;
        a tilt known from n presses and an albedo from n parts follow Student's distribution instead
        of a normal one; and errors of the level cause a common tilt by chance, by 1/n of their
        variance.  Of two presses or more the tilt is one part of a height's error beside the level,
        which many pixels tell: the sum has more degrees of freedom (Satterthwaite, "An approximate
        distribution of estimates of variance components", 1946).  Over a contact a tilt adds up,
        the level's errors as a random walk.  Slices of a single press tell less of others than they
        seem to.

        Parameters
        ----------
        film : what was fitted to all samples; the error of its LEDs is accounted for separately
        uneven : standard deviation of the brightness of touched film
        """
        held_out, pixel = self.folds, self.pixel
        rim = float(np.median(np.concatenate([balls.rim for balls, _ in held_out])))
        lags = np.arange(MIN_LAG_PX, max(rim / pixel, MIN_LAG_PX + 1)).astype(int)
        total = np.zeros((3, lags.size))
        tilts, spread, count = [], 0.0, 0
        for balls, fitted in held_out:
            errors, residual, truth = _residuals(balls, fitted, uneven)
            spread += float(np.square(errors).sum())
            count += errors.shape[1]
            outward, ball = _outward(truth), np.unique(balls.ball, return_inverse=True)[1]
            along, square = (np.bincount(ball, (e * outward).sum(0)) for e in (errors, outward))
            tilts += (along / square).tolist()
            errors = errors - (along / square)[ball] * outward
            total += _products(lags, balls, pixel, errors, residual)
        pairs = np.maximum(total[0], 1)
        normal, light = total[1:] / pairs
        chance = spread / (2 * max(count, 1)) / np.sqrt(pairs)
        possible = np.maximum(normal, 0) + chance
        # Covariance falls with distance: where it has fallen to one half.
        falling = isotonic_regression(possible, weights=pairs, increasing=False).x
        reach = float(np.interp(-falling[0] / 2, -falling, lags)) * pixel
        near = int(np.argmin(np.abs(lags - reach / pixel / 4)))
        sure = _root(normal[0] - chance[0])
        away = LedPlaces.of(film.other_lights).values - LedPlaces.of(film.lights).values
        common = np.mean([_led_tilt(*fold, away, uneven) for fold in held_out])
        tilt = _root(
            float(np.square(tilts).mean() - common * len(held_out) / max(len(held_out) - 1, 1))
        )
        level = _root(possible[0]) * float(np.sqrt(1 + 1 / len(held_out)))
        presses = np.unique(np.concatenate([balls.ball for balls, _ in held_out])).size
        alone = tilt * tilt * rim / max(tilt * tilt * rim + 2 * level * level * reach, 1e-30)
        freedom = len(tilts) / max(alone, 1e-3) ** 2 if presses > 1 else len(tilts)
        tilt *= _wider(freedom)
        tilt = float(np.hypot(tilt, sure / np.sqrt(presses)))
        return np.asarray([level, reach, _root(light[near]), _doubt(held_out), tilt], np.float32)

    def unevenness(self) -> float:
        """Return the standard deviation of the brightness of touched film, `Film.uneven`.

        A pixel's brightness is the least-squares factor between the light of the LEDs that reach it
        and that predicted for the true normal.  Noise drops out, because it is independent from
        pixel to pixel.
        """
        pairs, square = 0.0, 0.0
        for balls, fitted in self.folds:
            film, light = fitted.film, fitted.predicted(balls)
            direct = balls.on_plane(light, film) - balls.thrown(fitted.shifts, film)
            lit = direct > film.diffuse[:, None] + MIN_WEIGHT_LIGHT
            residual = np.where(lit, balls.on_plane(balls.light - light, film), 0)
            direct = np.where(lit, direct, 0)
            brightness = (residual * direct).sum(0) / np.maximum(
                np.square(direct).sum(0), MIN_WEIGHT_LIGHT
            )
            nothing, one = np.empty((0, balls.u.size)), np.array([MIN_LAG_PX])
            (more,), _, (product,) = _products(one, balls, self.pixel, nothing, brightness[None])
            pairs, square = pairs + more, square + product
        return BRIGHTENING_FACTOR * _root(float(square / max(pairs, 1)))


def _led_tilt(balls: Balls, fitted: Fitted, away: F8, uneven: float) -> float:
    """Mean square effect on `tilt` of LEDs that lie `away`, 8 x K x 3 of `LedPlaces`."""
    film, some = fitted.film, balls.thinned()
    truth, place, lift = some.touched_place(fitted.shifts, film)
    light, outward = predict(film, truth, *place, None, lift), _outward(truth)
    tilts = []
    for moved in LedPlaces.of(film.lights).values + away:
        other = film._replace(lights=cast(F4, LedPlaces(moved).positions))
        n = turned(other, light, truth, place, uneven, None, lift)
        tilts.append(((n - truth) * outward).sum() / np.square(outward).sum())
    return float(np.square(tilts).mean())


def _outward(normal: F8) -> F8:
    """The direction of increasing slant in a normal's tangent plane; zero on level film."""
    nx, ny, nz = normal
    sine = np.maximum(np.hypot(nx, ny), 1e-6)
    rising = np.minimum(sine / FULL_MISFIT_SLOPE.item(), 1)
    return np.asarray(rising * np.stack([nx * nz / sine, ny * nz / sine, -sine]))


def _residuals(balls: Balls, fitted: Fitted, uneven: float) -> tuple[F8, F8, F8]:
    """Errors of the normals (3 x N), residual light in matt units, and true normals."""
    film = fitted.film
    truth, solved, direct, place, lift = fitted.normals(balls, uneven)
    residual = direct - predict(film, solved, *place, None, lift)
    gain = touch_gain(film, lift)
    matt, diffuse = gain * direct_share(film)[:, None], gain * film.diffuse[:, None]
    residual, explained = residual / matt, (direct - residual - diffuse) / matt
    return solved - truth, residual - brighter(residual, explained, uneven) * explained, truth


def _products(lags: NDArray[np.intp], balls: Balls, pixel: float, errors: F8, residual: F8) -> F8:
    """Sums over pairs of a ball's pixels: their number, products of normals and of light, 3 x L.

    Pairs of a lag lie as far apart in any direction, within half a pixel.  The sums are the
    correlation of planes (Wiener 1930), which meets each pair from both of its ends.
    """
    total = np.zeros((3, lags.size))
    for ball in np.unique(balls.ball):
        at = balls.ball == ball
        row, column = (
            np.rint((p[at] - p[at].min()) / pixel).astype(int) for p in (balls.v, balls.u)
        )
        values = np.concatenate([np.ones((1, row.size)), errors[:, at], residual[:, at]])
        planes = np.zeros((len(values), row.max() + 1, column.max() + 1))
        planes[:, row, column] = values
        size = [next_fast_len(int(side + lags[-1]) + 1) for side in planes.shape[1:]]
        one, normal, light = np.split(np.square(np.abs(rfft2(planes, size))), [1, 1 + len(errors)])
        kinds = one, normal / 2, light / len(residual)
        products = irfft2(np.stack([kind.sum(axis=0) for kind in kinds]), size)
        down, right = (fftfreq(side, 1 / side) for side in size)
        away = np.rint(np.hypot(down[:, None], right)).astype(int).ravel()
        sums = [np.bincount(away, plane.ravel(), lags[-1] + 1)[lags] for plane in products]
        total += np.stack(sums) / 2
    return total


def _doubt(held_out: list[tuple[Balls, Fitted]]) -> float:
    """Relative uncertainty of the film's albedo, which is the mean over parts of the presses."""
    albedo = np.array([fitted.film.albedo for _, fitted in held_out])
    parts = len(albedo)
    if parts < 2 or albedo.mean() <= 0:
        return 0.0
    share = float(albedo.std(ddof=1) / np.sqrt(parts) / albedo.mean())
    return float(np.hypot(_wider(parts - 1) * share, MIN_BOUNCE_ERROR))


def _wider(freedom: float) -> float:
    """Student's quantile over the normal one that replaces it, at the end of the 90 % band."""
    return float(stdtrit(freedom, float(ndtr(BAND_DEVIATIONS))) / BAND_DEVIATIONS)


def _root(square: float) -> float:
    return float(np.sqrt(max(square, 0)))
