"""The standard deviation of every height."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import cv2
import numpy as np
from annotated_types import Ge, Gt, Interval
from scipy.linalg import hadamard

from tactograph.graph import node
from tactograph.nodes import (
    F4,
    Height,
    HeightError,
    Labels,
    Light,
    LightPositions,
    Mask,
    PixelSize,
    ShadowRises,
    Slope,
    SlopeVariance,
)
from tactograph.nodes._height_system import HeightSystem, Window, contact_window, height_system
from tactograph.nodes._near_light import light_vectors
from tactograph.nodes._springs import conjugate_gradients, hierarchy

SIGNS = hadamard(8).astype(np.float32)
"""A row per random error, a column per LED: what is common to an LED's light adds up exactly."""
STEEPEST = np.float32(3)
SINGULAR = np.float32(1e-4)
SHARPEST = np.float32(2)
"""A sharper kink counts as this sharp: its step has little weight."""

ENOUGH = 1e-6
"""The share of the steps' energy that may be left to gain."""


class _Response(NamedTuple):
    """What a small change of each LED's light does to the slope: K x H x W each."""

    by_p: F4
    by_q: F4

    def slope(self, change: F4) -> tuple[F4, F4]:
        """The change of p and q that a change of the lights (K x H x W) causes."""
        p, q = (self.by_p * change).sum(axis=0), (self.by_q * change).sum(axis=0)
        return np.clip(p, -STEEPEST, STEEPEST), np.clip(q, -STEEPEST, STEEPEST)


@node
def height_error(
    height: Height,
    slope: Slope,
    variance: SlopeVariance,
    rest: Mask,
    rises: ShadowRises,
    light: Light,
    sigma: Light,
    used: Labels,
    lights: LightPositions,
    pixel: PixelSize,
    mask: Mask | None = None,
    *,
    robust: Annotated[float, Gt(0)] = 2.0,
    bend: Annotated[float, Ge(0)] = 0.5,
    floor: Annotated[float, Gt(0)] = 0.05,
    rise_px: Annotated[float, Gt(0)] = 0.5,
    flat_noise: Annotated[float, Ge(0)] = 1.0,
    calibration: Annotated[float, Ge(0)] = 0.0003,
    aperture: Annotated[float, Ge(0)] = 0.1,
    kink: Annotated[float, Ge(0)] = 0.45,
    steps: Annotated[int, Interval(ge=1, le=1000)] = 8,
    seed: Annotated[int, Ge(0)] = 1,
) -> HeightError:
    """Send errors through the solver of `integrate_weighted` and see what they do.

    The height is, given the weights, linear in what it is made of.  A few random errors of
    the right size are integrated like slopes; the mean square of what comes out, averaged
    over neighbours, is the variance.  The errors are

    - the noise of each LED's light, and of the flat frame by which it was divided,
      independent from pixel to pixel;
    - an error of the calibration, common to all pixels of an LED, in proportion to the
      departure of its light from the film at rest (there the flat frame makes it exact);
    - what two or four slopes leave of a step, in proportion to their difference;
    - errors of the shadows' rises, independent of one another;
    - and one that all steep steps have in common: where the slope turns within a pixel, at
      rims and ridges, the slopes understate what is climbed, and the cap behind the rim
      comes out low as a whole.  It grows with the cube of the turn, as far as two.

    The calibration's errors have the signs of a Hadamard matrix's rows, so that their
    squares add up exactly; the last error is integrated alone, with its own sign.  On the
    film at rest the error is zero, as the height is by definition.

    Parameters
    ----------
    height
        H x W in mm, as integrated.
    slope, variance, rest, rises, pixel, mask, robust, bend, floor, rise_px
        As `integrate_weighted` had them.
    light, sigma
        K x H x W, and its standard deviation.
    used
        H x W, the LEDs the slope was found with.
    lights
        K x 3 in mm.
    flat_noise
        Noise of the flat frame as a share of a touch's: 1 if it is one frame, 1 / sqrt(n) if
        it is the mean of n.
    calibration
        Relative error of an LED's light.
    aperture
        Error of a step, in px, per difference of the slopes at its ends.
    kink
        Common error of all steps, in px, where that difference is 1.
    steps
        Conjugate gradients per error.
    seed
        Of the random errors.

    Returns
    -------
    ndarray
        H x W, one standard deviation in mm.
    """
    window = contact_window(rest, mask)
    system = height_system(
        window,
        slope,
        variance,
        rest,
        rises,
        pixel,
        mask,
        bend=bend,
        floor=floor,
        rise_px=rise_px,
    )
    springs = system.springs(window.of(height), robust)
    levels = hierarchy(springs)
    inside = window.of(light)
    noise = window.of(sigma) * np.sqrt(1 + np.square(np.float32(flat_noise) * inside))
    response = _response(window, height, slope, used, rest, sigma, lights, pixel)
    turn = _turns(system)
    rise_error = np.full(system.rise.shape, rise_px * pixel, np.float32)
    rng = np.random.default_rng(seed)
    level = np.zeros(inside.shape[1:], np.float32)

    def moved(right: F4, down: F4, rise: F4) -> F4:
        force = springs.pull(right, down, rise)
        enough = ENOUGH * springs.energy(right, down)
        return conjugate_gradients(levels, force, level, steps, enough)

    total = np.zeros_like(level)
    for sign in SIGNS:
        common = np.float32(calibration) * (inside - 1) * sign[: len(lights), None, None]
        p, q = response.slope(common + noise * _normal(rng, noise.shape))
        half = np.float32(0.5 * pixel)
        right = (p[:, 1:] + p[:, :-1]) * half
        down = (q[1:] + q[:-1]) * half
        right += np.float32(aperture) * turn[0] * _normal(rng, right.shape)
        down += np.float32(aperture) * turn[1] * _normal(rng, down.shape)
        total += np.square(moved(right, down, rise_error * _normal(rng, rise_error.shape)))
    total /= np.float32(len(SIGNS))
    total += np.square(moved(*_kink_errors(system, turn, kink, pixel), 0 * rise_error))
    out = np.zeros(rest.shape, np.float32)
    out[window.rows, window.columns] = _smooth_deviation(total, system.at_rest)
    return out


def _normal(rng: np.random.Generator, shape: tuple[int, ...]) -> F4:
    return rng.standard_normal(shape, dtype=np.float32)


def _response(
    window: Window,
    height: Height,
    slope: Slope,
    used: Labels,
    rest: Mask,
    sigma: Light,
    lights: LightPositions,
    pixel: float,
) -> _Response:
    """The derivative of the weighted least-squares normal by the lights, carried to p, q.

    In the tangent plane n + a (n_z, 0, -n_x) + b (0, n_z, -n_y); see `label_lights`.
    """
    vectors = window.of(light_vectors(lights, height, pixel))
    p, q = window.of(slope)
    nz = np.float32(1) / np.sqrt(np.float32(1) + p * p + q * q)
    along_a = (vectors[:, 0] + vectors[:, 2] * p) * nz
    along_b = (vectors[:, 1] + vectors[:, 2] * q) * nz
    numbers = np.arange(len(lights), dtype=np.uint8)[:, None, None]
    counts = np.ascontiguousarray(used[window.rows, window.columns]) >> numbers & 1
    noise = window.of(sigma)
    weight = counts / np.maximum(noise * noise, np.float32(1e-10))
    aa, ab, bb = (
        (weight * first * second).sum(axis=0)
        for first, second in ((along_a, along_a), (along_a, along_b), (along_b, along_b))
    )
    determinant = aa * bb - ab * ab
    known = (determinant > SINGULAR * aa * bb) & (rest[window.rows, window.columns] == 0)
    inverse = np.where(known, np.float32(1) / np.where(known, determinant, 1), np.float32(0))
    by_a = weight * (bb * along_a - ab * along_b) * inverse
    by_b = weight * (aa * along_b - ab * along_a) * inverse
    return _Response(
        np.asarray(-((1 + p * p) * by_a + p * q * by_b), np.float32),
        np.asarray(-(p * q * by_a + (1 + q * q) * by_b), np.float32),
    )


def _turns(system: HeightSystem) -> tuple[F4, F4]:
    """By how much the steps to the right and down differ from those beside them, in mm."""
    return (
        np.abs(np.gradient(system.right, axis=1))
        if system.right.shape[1] > 1
        else np.zeros_like(system.right),
        np.abs(np.gradient(system.down, axis=0))
        if system.down.shape[0] > 1
        else np.zeros_like(system.down),
    )


def _kink_errors(
    system: HeightSystem, turn: tuple[F4, F4], kink: float, pixel: float
) -> tuple[F4, F4]:
    """What the steps to the right and down lack if all lack it uphill, in mm."""

    def lacking(step: F4, turned: F4) -> F4:
        slopes = np.minimum(turned / np.float32(pixel), SHARPEST)
        return np.asarray(np.float32(kink * pixel) * slopes**3 * np.sign(step), np.float32)

    return lacking(system.right, turn[0]), lacking(system.down, turn[1])


def _smooth_deviation(variance: F4, at_rest: F4, spread: float = 3.0) -> F4:
    """The root of the variance, averaged over the neighbours that are not at rest."""
    free = 1 - at_rest
    total = cv2.GaussianBlur(variance * free, (0, 0), spread)
    weight = np.maximum(cv2.GaussianBlur(free, (0, 0), spread), np.float32(1e-3))
    return np.asarray(np.sqrt(np.maximum(total / weight, 0)) * free, np.float32)
