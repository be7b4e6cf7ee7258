"""The random errors of the slopes: the effect of each cause to first order.

``kernels/error/height_error.cl`` computes the same (err_slopes).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import (
    BAND_DEVIATIONS,
    F4,
    FULL_MISFIT_SLOPE,
    LEVEL_MISFIT_SHARE,
    U1,
    Film,
    Misfit,
)
from tactograph.nodes.error._random_errors import (
    BOUNCE_SIGNS,
    ERROR_COUNT,
    LEAN_SIGNS,
    LED_SIGNS,
    MEAN_SIGNS,
    SETTLING_SIGNS,
    drawn,
    key_of,
    wave,
)
from tactograph.nodes.optics.cache_blocks import in_blocks
from tactograph.nodes.optics.difference import second_differences
from tactograph.nodes.optics.film import coat_sharpness, predict
from tactograph.nodes.optics.near_light import (
    brightness_share,
    expected_light,
    light_by_place,
    vectors_at,
)
from tactograph.nodes.slope.pixel_mean_slope import MAX_CORRECTION, PIXEL_VARIANCE

MIN_DETERMINANT_SHARE = np.float32(1e-4)
"""Determinant over the product of its diagonal below which all LEDs lie in one line."""
MIN_DIVISOR = np.float32(1e-10)
"""Lower bound on a variance, or deviation of a slope, in a denominator."""
MAX_SLOPE = np.float32(3)
"""Largest error of a slope."""
UNSHARP_SHARE = np.float32(1 / math.sqrt(3))
"""Root mean square of what `sharpen_slope` leaves of a blur's effect, over what it undoes: nothing
on wide bends, as much again on sharp folds."""
FOLD_VARIANCES = np.float32(BAND_DEVIATIONS * math.sqrt(37))
"""Noise of `folds`, at the end of the 90 % band, over the variance of a slope: slopes extrapolated
from two pixels differ from the one between them by 6 variances, and both share it by -1."""
SEEN_FOLD_FACTOR = np.float32(1.5)
"""Variance of light within a pixel and its blur, over what the gradients of the light seen give,
which has been blurred: 1 on wide bends, 2 on sharp folds."""


class Unperturbed(NamedTuple):
    """The values without error, inside the window."""

    sigma: F4
    """K x h x w."""
    slope: F4
    """2 x h x w."""
    height: F4
    x: F4
    """1 x w, in mm from the middle of the image."""
    y: F4
    """h x 1."""
    used: U1
    """The LEDs that the slope was found with."""
    free: NDArray[np.bool_]
    """Mask of film that is not at rest, whose height is unknown."""
    bounced: F4
    """K x h x w, the light from film to film; zero if none is given."""
    unsettled: F4
    """`bounced` minus the light from film to film of the height found, K x h x w."""
    sunk: F4
    """`slope` minus the slope of the film at rest, where the flat frame cancels model errors."""
    averaged: F4
    """`slope` minus the slope of the pixels' mean normals."""

    def rows(self, part: slice) -> Unperturbed:
        """These values for some rows."""
        inside = {name: plane[..., part, :] for name, plane in self._asdict().items()}
        return Unperturbed(**{**inside, "x": self.x})


class Causes(NamedTuple):
    """The causes of errors, with their sizes."""

    film: Film
    """The LEDs' positions, the alternatives within their error, and the film's unevenness."""
    misfit: Misfit
    shared: np.float32
    """Factor on a touch's noise, for correlation, for the flat frame's noise, and for few draws."""
    pixel: np.float32
    spread: np.float32
    """Variance in px^2 within which light is mixed (`mixing`)."""
    folded: bool
    """Whether `folds` count."""


def slope_errors(unperturbed: Unperturbed, causes: Causes, seed: int) -> F4:
    """Return all errors of the slopes inside the window, ERROR_COUNT x 2 x h x w."""
    (rows, columns), film = unperturbed.height.shape, causes.film
    errors = np.empty((ERROR_COUNT, 2, rows, columns), np.float32)
    light, sharper = np.empty_like(unperturbed.sigma), np.empty_like(unperturbed.height)

    def shine(part: slice) -> None:
        light[:, part], sharper[part] = _shown(unperturbed.rows(part), film)

    in_blocks(shine, rows, columns)
    fold = folds(unperturbed.slope, light) if causes.folded else None
    is_sharpened = film.refraction == 1 and not film.diffuse.any()
    gathered = causes.spread / 2 * np.stack([sum(second_differences(plane)) for plane in light])

    def enter(part: slice) -> None:
        inside = unperturbed.rows(part)
        by_light = slope_by_light(inside, causes)
        by_place = light_by_place(film.lights, inside.x, inside.y, inside.height, inside.slope)
        by_apparent = by_light / sharper[part]
        root = _root_of_noise(by_apparent * (causes.shared * inside.sigma))
        flatter = -(by_apparent * gathered[:, part]).sum(axis=1)
        most = np.float32(is_sharpened * MAX_CORRECTION) * (1 + (inside.slope**2).sum(axis=0))
        sharpened = (1 - UNSHARP_SHARE) * np.clip(flatter, -most, most)
        mean = inside.averaged + flatter - sharpened
        if fold is not None:
            hidden, turn = (plane[..., part, :] for plane in fold)
            noise = sum(each * each for each in root)
            mean += np.where(turn > FOLD_VARIANCES * noise, hidden, np.float32(0))
        for number, other in enumerate(film.other_lights):
            elsewhere = (other - film.lights)[:, :, None, None]
            wrong = (by_place * elsewhere).sum(axis=1)
            wrong += causes.misfit[2] * LED_SIGNS[number, : len(wrong), None, None]
            error = (by_light * wrong).sum(axis=1)
            # A share of the bounced light, and what further passes would change.
            wrong = BOUNCE_SIGNS[number] * causes.misfit[3] * inside.bounced
            wrong += SETTLING_SIGNS[number] * inside.unsettled
            error += (by_apparent * wrong).sum(axis=1)
            error += _noise(root, key_of(seed, number), part.start * columns, rows * columns)
            error = np.clip(error + MEAN_SIGNS[number] * mean, -MAX_SLOPE, MAX_SLOPE)
            error += _leaning(inside, causes.misfit, causes.pixel, number)
            errors[number, :, part] = np.clip(error, -MAX_SLOPE, MAX_SLOPE)

    in_blocks(enter, rows, columns)
    return errors


def mixing(refraction: float, blur: float | None) -> tuple[np.float32, bool]:
    """Return the variance in px^2 within which light is mixed, and whether folds tell the rest.

    Under a coat they tell it while their sides, a pixel away, lie beyond two deviations of the
    blur.  A wider blur bends them, and the light that it mixes follows from its own gradients.
    """
    square, coated = np.float32((blur or 0.0) ** 2), refraction != 1
    if not coated or 4 * square <= 1:
        return square, coated
    return SEEN_FOLD_FACTOR * (square + PIXEL_VARIANCE), False


def folds(slope: F4, light: F4) -> tuple[F4, F4]:
    """Return what folds hide of pixels' mean slopes, 2 x h x w, and how sharply they turn, h x w.

    A pixel on a fold has a mixture of the light of both sides, which two pixels on each side tell.
    The mean slope is the same mixture of their slopes, but under a coat it is not the slope that
    has this light.  On a fold the product of the slope's differences from both sides is positive;
    smooth film bends away from both, and it is negative.
    """
    film = np.concatenate([slope, light])
    hidden, turn = np.zeros_like(slope), np.zeros_like(slope[0])
    for axis in (1, 2):
        at, last = np.arange(film.shape[axis]), film.shape[axis] - 1
        two, one, next_, third = (film.take((at + n).clip(0, last), axis) for n in (-2, -1, 1, 2))
        before, after = 2 * one - two, 2 * next_ - third
        across, up = after - before, film - before
        product = (up[:2] * (across - up)[:2]).sum(axis=0)
        along, square = (up * across)[2:].sum(axis=0), (across * across)[2:].sum(axis=0)
        share = np.clip(along / np.maximum(square, MIN_DIVISOR), 0, 1)
        hidden = np.where(product > turn, share * across[:2] - up[:2], hidden)
        turn = np.maximum(turn, product)
    return hidden, turn


def slope_by_light(unperturbed: Unperturbed, causes: Causes) -> F4:
    """Return the derivative of p and q by each LED's light, 2 x K x h x w; 0 on film at rest.

    The derivative of the weighted least-squares normal by the lights, transformed to p and q, in
    the tangent plane n + a (n_z, 0, -n_x) + b (0, n_z, -n_y).  For three LEDs or more the film's
    brightness is free; see `label_lights`.
    """
    p, q = unperturbed.slope
    nz = 1 / np.sqrt(1 + p * p + q * q)
    vectors = vectors_at(causes.film.lights, unperturbed.x, unperturbed.y, unperturbed.height)
    model_light = expected_light(vectors, unperturbed.slope)
    a, b = (vectors[:, 0] + vectors[:, 2] * p) * nz, (vectors[:, 1] + vectors[:, 2] * q) * nz
    counts = unperturbed.used >> np.arange(len(vectors), dtype=np.uint8)[:, None, None] & 1
    weight = counts / np.maximum(unperturbed.sigma * unperturbed.sigma, MIN_DIVISOR)
    weighted = weight * model_light
    share = brightness_share(
        (weighted * model_light).sum(axis=0), np.float32(1), np.float32(causes.film.uneven)
    )
    share = np.where(counts.sum(axis=0) > 2, share, np.float32(0))
    of_a, of_b = (
        weight * (along - share * (weighted * along).sum(axis=0) * model_light) for along in (a, b)
    )
    aa, ab, bb = (of_a * a).sum(axis=0), (of_a * b).sum(axis=0), (of_b * b).sum(axis=0)
    determinant = aa * bb - ab * ab
    is_determined = (determinant > MIN_DETERMINANT_SHARE * aa * bb) & unperturbed.free
    inverse = np.where(is_determined, 1 / np.where(is_determined, determinant, 1), np.float32(0))
    by_a, by_b = (bb * of_a - ab * of_b) * inverse, (aa * of_b - ab * of_a) * inverse
    by_p, by_q = (1 + p * p) * by_a + p * q * by_b, p * q * by_a + (1 + q * q) * by_b
    return np.asarray([-by_p, -by_q], np.float32)


def _shown(at: Unperturbed, film: Film) -> tuple[F4, F4]:
    """The light of the slopes, relative to the film at rest, on a matt film's scale.

    Also by how much more the light of a coat changes with the slope than a matt film's.  The effect
    of an LED's position grows by the same factor, so its effect on the slope stays.
    """
    if film.refraction == 1:
        vectors = vectors_at(film.lights, at.x, at.y, at.height)
        return np.maximum(expected_light(vectors, at.slope), 0), np.ones_like(at.height)
    z = at.height / (1 + film.camera * at.height)
    nearer = 1 - film.camera * z
    flat = (*at.slope, *np.broadcast_arrays(at.x * nearer, at.y * nearer, z))
    p, q, *place = (plane.ravel() for plane in flat)
    normal = np.stack([-p, -q, np.ones_like(p)]) / np.sqrt(1 + p * p + q * q)
    lit = at.used >> np.arange(len(at.sigma), dtype=np.uint8)[:, None, None] & 1
    weight = (lit / np.maximum(at.sigma * at.sigma, MIN_DIVISOR)).reshape(len(lit), -1)
    plain = film._replace(gain=1.0, emission=0.0, wrap=0.0)._replace(
        diffuse=0 * film.diffuse, harmonics=0 * film.harmonics
    )
    sharper = coat_sharpness(film, normal, (place[0], place[1], place[2]), weight)
    light = predict(plain, normal, *place).reshape(at.sigma.shape)
    return light, np.asarray(sharper.reshape(at.height.shape), np.float32)


def _root_of_noise(noise: F4) -> tuple[F4, F4, F4]:
    """A root of the covariance of p and q due to the noise of the lights, 2 x K x h x w.

    The standard deviation of p, and the parts of q's noise that are correlated with it and not.
    """
    alone = np.sqrt((noise[0] * noise[0]).sum(axis=0))
    along = (noise[0] * noise[1]).sum(axis=0) / np.maximum(alone, MIN_DIVISOR)
    rest = (noise[1] * noise[1]).sum(axis=0) - along * along
    return alone, along, np.sqrt(np.maximum(rest, np.float32(0)))


def _noise(root: tuple[F4, F4, F4], key: int, first: int, pixels: int) -> F4:
    """Draw the noise of p and q for the pixels from number `first` on, of `pixels`."""
    alone, along, across = root
    of_both = drawn(key, alone.shape, first)
    of_q = drawn(key, alone.shape, pixels + first)
    return np.asarray([alone * of_both, along * of_both + across * of_q])


def _leaning(unperturbed: Unperturbed, misfit: Misfit, pixel: np.float32, number: int) -> F4:
    """The error of the film's model (H3): normals lean in waves, and all are too steep or flat."""
    (p, q), waves = unperturbed.sunk, wave(number)
    per_mm = np.float32(2 * math.pi) / (waves.length * np.maximum(misfit[1], pixel))
    turned = per_mm * (waves.across * unperturbed.x + waves.down * unperturbed.y) + waves.phase
    square = p * p + q * q
    slant = np.sqrt(square)
    tilted = np.clip(slant / FULL_MISFIT_SLOPE, LEVEL_MISFIT_SHARE, 1)
    lean = np.float32(math.sqrt(2)) * misfit[0] * tilted * np.cos(turned)
    steeper = LEAN_SIGNS[number] * misfit[4] / np.maximum(slant, FULL_MISFIT_SLOPE)
    uphill = lean * (waves.across * p + waves.down * q) + steeper * (1 + square)
    return np.asarray([lean * waves.across + uphill * p, lean * waves.down + uphill * q])
