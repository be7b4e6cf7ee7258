"""The standard deviation of a scan's height, from what the light leaves unexplained."""

import cv2
import numpy as np

from tactograph.rings.metrology.nodes.scan._scan_levelling import ScanLevelling
from tactograph.rings.metrology.nodes.scan.light_model import MIN_DIVISOR, PIXEL_UNKNOWNS
from tactograph.rings.metrology.nodes.scan.light_model_slope import ModelSlope
from tactograph.sdk import F4

DRAW_COUNT = 16
"""Random errors; they come in pairs, whose waves are a quarter of a wave apart."""
REPEAT_TURN, REPEAT_FRAME = np.float32(1), np.float32(2)
"""Change of the normal, and of the position over the frame's shorter side, after which a model's
error repeats."""
CHI_MEDIAN = 0.789
"""Median over mean of a sum of three squares."""
MAX_SLOPE_ERROR = np.float32(3)
"""Largest error of a slope."""
NOISE_STEEPENING = np.float32(2)
"""Error of slopes that are steepened by noise, over the variances of p and q of a pixel and the
slope: 1.1 to 2.8 on walls of 25 to 45 degrees, by second derivatives of three sensors' models."""
NOISE_MEAN_CELLS = 2.0
"""Cells over which the noise is averaged."""
MIN_SHOWN = np.float32(1e-6)
"""Smallest share of cells around that show noise."""


def scan_errors(
    solved: ModelSlope, single: F4, levelling: ScanLevelling, cell: int, seed: int
) -> tuple[F4, F4]:
    """Send random errors of the light the height's own way; and the variance inside a cell.

    The squares of the 1 + `DRAW_COUNT` heights add up to the variance; the first is certain.

    What slope and brightness leave of a single pixel's light is noise and the model's error, what
    they leave of a cell's mean light hardly any noise: the two tell both apart.

    - Noise is independent from pixel to pixel.  What it does inside a cell of n x n pixels is
      ln(n) / (2 pi) times the variance of a pixel's slope, in px^2.
    - The model's error is a wave of normal and position, another one for every LED: film of one
      slope errs alike wherever it lies, so that the depth of a groove errs with its walls.  The
      waves are the same ones for every scan, so that a known step tells what another errs by.

    Noise also makes slopes steeper, to second order, and what it does on a wall it does in cells
    that show a part of it.  As brightness is free, light that is wrong under all LEDs alike turns
    no normal.
    """
    slope, by_light = solved.slope, levelling.by_light
    leds = by_light.shape[1]
    noise, misfit = _parts(solved.residual, single, leds, cell)
    root = _root(by_light) * noise
    normal = slope / np.sqrt(1 + np.sum(slope * slope, axis=0))
    where = np.stack([*(normal / REPEAT_TURN), *(each / REPEAT_FRAME for each in levelling.place)])

    of_pixel = cv2.dilate(np.square(root * cell).sum(axis=(0, 1)), np.ones((3, 3)))
    wrong = [slope * NOISE_STEEPENING * of_pixel]
    for number in range(DRAW_COUNT):
        waves = np.float32(misfit) * _waves(number, leds, where)
        of_model = np.einsum("aknm,knm->anm", by_light, waves)
        noise_draw = np.random.default_rng([seed, number]).standard_normal(slope.shape, np.float32)
        wrong.append(of_model + np.einsum("abnm,bnm->anm", root, noise_draw))
    limits = -MAX_SLOPE_ERROR, MAX_SLOPE_ERROR
    errors = np.stack([levelling.heights(np.clip(each, *limits)) for each in wrong])
    errors[1:] /= np.sqrt(DRAW_COUNT)
    inside = np.log(cell) / (4 * np.pi) * np.square(root).sum(axis=(0, 1)) * levelling.pixel**2
    return errors.astype(np.float32), inside


def _parts(residual: F4, single: F4, leds: int, cell: int) -> tuple[F4, float]:
    """Standard deviations of a LED's light: noise of a cell's mean, H x W, and the model's error.

    Of n x n pixels the mean has 1 / n of a pixel's noise.  A cell with a fold leaves more than a
    pixel, since its mean light is that of no slope: there neighbours tell the noise.
    """
    per_led = leds / (leds - PIXEL_UNKNOWNS)
    square, of_cell = (per_led * np.square(each) for each in (single, residual))
    flat = (of_cell < square).astype(np.float32)
    excess = flat * (square - of_cell)
    variance, flat_mean = (
        cv2.GaussianBlur(each, (0, 0), NOISE_MEAN_CELLS) for each in (excess, flat)
    )
    noise = np.sqrt(variance / np.maximum(flat_mean, MIN_SHOWN)) / cell
    misfit = np.median(of_cell) / CHI_MEDIAN - np.median(noise) ** 2
    return noise.astype(np.float32), float(np.sqrt(max(misfit, 0)))


def _root(by_light: F4) -> F4:
    """A root of the covariance of p and q by equal noise of all LEDs: 2 x 2 x H x W."""
    (pp, pq), (_, qq) = np.einsum("aknm,bknm->abnm", by_light, by_light)
    alone = np.sqrt(pp + MIN_DIVISOR)
    shared = pq / alone
    return np.stack([[alone, 0 * alone], [shared, np.sqrt(np.maximum(qq - shared**2, 0))]])


def _waves(number: int, leds: int, where: F4) -> F4:
    """A wave of normal and position for every LED, of variance 1: K x H x W.

    Those of an odd number are a quarter of a wave ahead of those before.
    """
    turned, moved, start = np.random.default_rng(number // 2).uniform(0, 2 * np.pi, (3, leds))
    wave = np.stack([np.cos(turned), np.sin(turned), np.cos(moved), np.sin(moved)], 1)
    phase = np.tensordot(2 * np.pi * wave.astype(np.float32), where, 1)
    ahead = (start + number % 2 * np.pi / 2).astype(np.float32)
    return np.asarray(np.sqrt(2) * np.cos(phase + ahead[:, None, None]), np.float32)
