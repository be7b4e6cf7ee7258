"""The standard deviation of a height by a light model, from what the light leaves unexplained."""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Interval

from tactograph.graph import Port, SizeLimit, node
from tactograph.nodes import F4, F8, HeightError, PixelSize, Slope
from tactograph.nodes.error._random_errors import drawn, keys_of
from tactograph.nodes.height.integrate_dct import integrate_dct
from tactograph.nodes.metrology.level_plane import (
    level_part,
    plane_terms,
    plane_weights,
)
from tactograph.nodes.optics.gauss_newton import along, normal_by_slope
from tactograph.nodes.optics.light_model import (
    LightModel,
    coefficients,
    modelled_light,
    monomials,
    positions,
)

DRAW_COUNT = 16
"""Random errors; they come in pairs, whose waves are a quarter of a wave apart."""
PIXEL_UNKNOWNS = 3
"""Unknowns of a pixel: p, q and the brightness.  Only more LEDs than these show a model's error."""
REPEAT_TURN, REPEAT_FRAME = np.float32(1), np.float32(2)
"""Change of the normal, and of the position over the frame's shorter side, after which a model's
error repeats."""
CHI_MEDIAN = 0.789
"""Median over mean of a sum of three squares."""
MIN_DIVISOR = 1e-9
MAX_SLOPE_ERROR = np.float32(3)
"""Largest error of a slope."""
NOISE_STEEPENING = np.float32(1.5)
"""Steepening of slopes by noise, over the variances of p and q of a pixel and the slope: 1.0 to
2.5 by the models of three sensors."""
NOISE_MEAN_CELLS = 2.0
"""Cells over which the noise is averaged."""


@node(sizes={"K": SizeLimit(4, 8, "three leave nothing to tell the error by")})
def light_model_error(
    slope: Slope,
    brightness: Annotated[F4, Port("H W", "1", high=2)],
    residual: Annotated[F4, Port("H W", "1", high=0.1)],
    single: Annotated[F4, Port("H W", "1", high=0.1)],
    model: LightModel,
    pixel: PixelSize,
    *,
    cell: Annotated[int, Interval(ge=1, le=64)] = 16,
    level: str = "plane",
    seed: Annotated[int, Ge(0)] = 1,
) -> HeightError:
    """Return the standard deviation of the height, by sending errors the height's own way.

    All inputs are of cells.  What slope and brightness leave of a single pixel's light is noise
    and the model's error, what they leave of a cell's mean light hardly any noise: the two tell
    both apart.  `DRAW_COUNT` random errors of the right size are turned into slopes to first order,
    integrated, and levelled as the height was; their mean square is the variance.

    - Noise is independent from pixel to pixel.  What it does inside a cell of n x n pixels is
      ln(n) / (2 pi) times the variance of a pixel's slope, in px^2.
    - The model's error is a wave of normal and position, another one for every LED: film of one
      slope errs alike wherever it lies, so that the depth of a groove errs with its walls.

    Noise also makes slopes steeper, to second order.  As brightness is free, light that is wrong
    under all LEDs alike turns no normal.

    Parameters
    ----------
    slope, brightness, residual
        As `light_model_slope` finds them from the mean light of cells.
    single
        The residual of one pixel of every cell.
    model
        The light model on cells.
    pixel
        Side of a cell in mm.
    cell
        Side of a cell in pixels.
    level
        As for `level_plane`.
    seed
        Seed of the random errors.

    Returns
    -------
    ndarray
        H x W, in mm, above the plane that the height is levelled to.
    """
    pixels: F4 = np.indices(residual.shape, np.float32)
    place = positions(pixels[1], pixels[0], model.view)
    by_light = _slope_by_light(slope, brightness, model, place)
    leds, rows, columns = by_light.shape[1:]
    noise, misfit = _parts(residual, single, leds, cell)
    root = _root(by_light) * noise
    normal = slope / np.sqrt(1 + np.sum(slope * slope, axis=0))
    where = np.stack([*(normal / REPEAT_TURN), *(each / REPEAT_FRAME for each in place)])
    terms, plane = _plane(slope, pixel, level, cell)

    def above_plane(wrong: F4) -> F8:
        height = integrate_dct(np.clip(wrong, -MAX_SLOPE_ERROR, MAX_SLOPE_ERROR), pixel).ravel()
        return (height - terms @ (plane @ height)).reshape(rows, columns)

    total = np.square(
        above_plane(slope * NOISE_STEEPENING * np.square(root * cell).sum(axis=(0, 1)))
    )
    for number in range(DRAW_COUNT):
        waves = np.float32(misfit) * _waves(number, leds, where)
        wrong = np.einsum("aknm,knm->anm", by_light, waves)
        wrong += np.einsum("abnm,bnm->anm", root, drawn(keys_of(seed, number).light, slope.shape))
        total += np.square(above_plane(wrong)) / DRAW_COUNT
    inside = np.log(cell) / (4 * np.pi) * np.square(root).sum(axis=(0, 1)) * pixel**2
    return np.sqrt(total + inside).astype(np.float32)


def _slope_by_light(slope: F4, brightness: F4, model: LightModel, place: tuple[F4, F4]) -> F4:
    """The derivative of p and q by each LED's light, 2 x K x H x W, with the brightness free."""
    powers = monomials(*place, int(model.degree))
    _, n, by_p, by_q = normal_by_slope(*slope)
    m, gradient = modelled_light(coefficients(model.quadratic, powers), np.stack(n))
    norm = np.maximum(np.sum(m * m, axis=0), MIN_DIVISOR)
    free = []
    for direction in (by_p, by_q):
        j = along(tuple(gradient), direction)
        free.append(brightness * (j - m * (np.sum(m * j, axis=0) / norm)))
    x_by, y_by = free
    xx, xy, yy = (np.sum(a * b, axis=0) for a, b in combinations_with_replacement(free, 2))
    determinant = np.maximum(xx * yy - xy * xy, MIN_DIVISOR)
    return np.stack([yy * x_by - xy * y_by, xx * y_by - xy * x_by]) / determinant


def _parts(residual: F4, single: F4, leds: int, cell: int) -> tuple[F4, float]:
    """Standard deviations of a LED's light: noise of a cell's mean, H x W, and the model's error.

    Of n x n pixels the mean has 1 / n of a pixel's noise.
    """
    per_led = leds / (leds - PIXEL_UNKNOWNS)
    square, of_cell = (per_led * np.square(each) for each in (single, residual))
    variance = np.maximum(cv2.GaussianBlur(square - of_cell, (0, 0), NOISE_MEAN_CELLS), 0)
    noise = np.sqrt(variance / cell**2)
    left = np.median(of_cell) / CHI_MEDIAN - np.median(noise) ** 2
    return noise.astype(np.float32), float(np.sqrt(max(left, 0)))


def _root(by_light: F4) -> F4:
    """A root of the covariance of p and q by equal noise of all LEDs: 2 x 2 x H x W."""
    (pp, pq), (_, qq) = np.einsum("aknm,bknm->abnm", by_light, by_light)
    alone = np.sqrt(pp + MIN_DIVISOR)
    shared = pq / alone
    return np.stack([[alone, 0 * alone], [shared, np.sqrt(np.maximum(qq - shared**2, 0))]])


def _plane(slope: Slope, pixel: float, level: str, cell: int) -> tuple[F8, F8]:
    """The terms of a plane, N x 3, and what finds the plane that is subtracted, 3 x N."""
    shape = slope.shape[1], slope.shape[2]
    terms = np.stack([np.broadcast_to(t, shape).ravel() for t in plane_terms(*shape)], 1)
    marked = level_part(level, shape, cell)
    if marked is None:
        weights = plane_weights(terms, integrate_dct(slope, pixel).ravel().astype(float))
    else:
        weights = marked.ravel().astype(float)
    weighted = terms * weights[:, None]
    return terms, np.linalg.pinv(weighted.T @ terms) @ weighted.T


def _waves(number: int, leds: int, where: F4) -> F4:
    """A wave of normal and position for every LED, of variance 1: K x H x W.

    Those of an odd number are a quarter of a wave ahead of those before.
    """
    turned, moved, start = np.random.default_rng(number // 2).uniform(0, 2 * np.pi, (3, leds))
    wave = np.stack([np.cos(turned), np.sin(turned), np.cos(moved), np.sin(moved)], 1)
    phase = np.tensordot(2 * np.pi * wave.astype(np.float32), where, 1)
    ahead = (start + number % 2 * np.pi / 2).astype(np.float32)
    return np.asarray(np.sqrt(2) * np.cos(phase + ahead[:, None, None]), np.float32)
