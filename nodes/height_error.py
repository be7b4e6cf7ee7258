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

STEEPEST = np.float32(3)
SINGULAR = np.float32(1e-4)


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
    *,
    robust: Annotated[float, Gt(0)] = 2.5,
    bend: Annotated[float, Ge(0)] = 0.25,
    floor: Annotated[float, Gt(0)] = 0.07,
    rise_px: Annotated[float, Gt(0)] = 0.5,
    flat_noise: Annotated[float, Ge(0)] = 1.0,
    calibration: Annotated[float, Ge(0)] = 0.0002,
    aperture: Annotated[float, Ge(0)] = 0.2,
    soft_px: Annotated[float, Ge(0)] = 0.15,
    hard_px: Annotated[float, Ge(0)] = 0.5,
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
    - errors of the shadows' rises, half of their square common to all shadows of an LED.
      An edge lit at a grazing angle measures better than one that is fully lit.

    Common errors have the signs of a Hadamard matrix's rows, so that their squares add up
    exactly.  On the film at rest the error is zero, as the height is by definition.

    Parameters
    ----------
    height
        H x W in mm, as integrated.
    slope, variance, rest, rises, pixel, robust, bend, floor, rise_px
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
    soft_px, hard_px
        Error of a rise from a grazing edge, and what full light adds to it.
    steps
        Conjugate gradients per error.
    seed
        Of the random errors.

    Returns
    -------
    ndarray
        H x W, one standard deviation in mm.
    """
    window = contact_window(rest)
    system = height_system(
        window, slope, variance, rest, rises, pixel, bend=bend, floor=floor, rise_mm=rise_px * pixel
    )
    springs = system.springs(window.of(height), robust)
    levels = hierarchy(springs)
    inside = window.of(light)
    noise = window.of(sigma) * np.sqrt(1 + np.square(np.float32(flat_noise) * inside))
    response = _response(window, height, slope, used, rest, sigma, lights, pixel)
    steps_error = _step_errors(system, aperture)
    rise_error = _rise_errors(system, inside, soft_px, hard_px, pixel)
    rng = np.random.default_rng(seed)
    total = np.zeros(inside.shape[1:], np.float32)
    signs = _signs(len(lights))
    for sign in signs:
        common = np.float32(calibration) * (inside - 1) * sign[: len(lights), None, None]
        p, q = response.slope(common + noise * _normal(rng, noise.shape))
        half = np.float32(0.5 * pixel)
        right = (p[:, 1:] + p[:, :-1]) * half + steps_error[0] * _normal(rng, system.right.shape)
        down = (q[1:] + q[:-1]) * half + steps_error[1] * _normal(rng, system.down.shape)
        common_rise = sign[len(lights) + system.rise_led.astype(int) - 1]
        rise = rise_error * (_normal(rng, rise_error.shape) + common_rise)
        force = springs.pull(right, down, rise)
        moved = conjugate_gradients(levels, force, np.zeros_like(total), steps, 1e-3)
        total += moved * moved
    out = np.zeros(rest.shape, np.float32)
    out[window.rows, window.columns] = _smooth_deviation(
        total / np.float32(len(signs)), system.at_rest
    )
    return out


def _signs(count: int) -> F4:
    """Rows of +-1, a column for the light and one for the shadows of each LED."""
    return hadamard(1 << (2 * count - 1).bit_length()).astype(np.float32)


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


def _step_errors(system: HeightSystem, aperture: float) -> tuple[F4, F4]:
    """What the slopes at both ends leave open of the steps to the right and down, in mm.

    The difference of the slopes at the ends of a step is that of the steps beside it.
    """
    turn_right = np.abs(np.gradient(system.right, axis=1)) if system.right.shape[1] > 1 else 0
    turn_down = np.abs(np.gradient(system.down, axis=0)) if system.down.shape[0] > 1 else 0
    size = np.float32(aperture)
    return (
        size * np.broadcast_to(turn_right, system.right.shape).astype(np.float32),
        size * np.broadcast_to(turn_down, system.down.shape).astype(np.float32),
    )


def _rise_errors(
    system: HeightSystem, light: Light, soft_px: float, hard_px: float, pixel: float
) -> F4:
    """Standard deviation of each rise in mm, by the light on the edge that casts the shadow."""
    led = system.rise_led.astype(int) - 1
    edge = np.clip(light.reshape(len(light), -1)[led, system.rises.top], 0, 1)
    return np.asarray((np.float32(soft_px) + np.float32(hard_px) * edge) * np.float32(pixel))


def _smooth_deviation(variance: F4, at_rest: F4, spread: float = 3.0) -> F4:
    """The root of the variance, averaged over the neighbours that are not at rest."""
    free = 1 - at_rest
    total = cv2.GaussianBlur(variance * free, (0, 0), spread)
    weight = np.maximum(cv2.GaussianBlur(free, (0, 0), spread), np.float32(1e-3))
    return np.asarray(np.sqrt(np.maximum(total / weight, 0)) * free, np.float32)
