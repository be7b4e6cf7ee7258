"""Find how high film still is that looks at rest: the skirt of a touch."""

from typing import NamedTuple

import cv2
import numpy as np

from tactograph.graph import node
from tactograph.nodes import F8, Height, HeightError, Mask, Misfit, PixelSize, Slope, SlopeVariance

TRIAL_REACHES, MIN_SQUARE = 40, 1e-30
"""Number of reaches that are tried, in equal ratios; lower bound on a square in a denominator."""


class Skirt(NamedTuple):
    """The height that film at rest was held below, and its standard deviation."""

    height: Height
    error: HeightError


@node
def skirt_height(
    slope: Slope, variance: SlopeVariance, rest: Mask, misfit: Misfit, pixel: PixelSize
) -> Skirt:
    """Return how high the film is above zero where it was held at zero, and beside it.

    Stretched film on a soft base returns to rest like a exp(-d / reach).  Its slopes fall below the
    noise of a pixel while it is still some micrometres high, but the mean of all slopes at one
    distance d from the film that moves shows them.  For each reach, from a pixel to the largest
    d, least squares fit a to those means, and a fall that all film shares, since the model of its
    light errs; reaches count by their likelihood.  So the skirt is the mean of a reach
    exp(-d / reach), and its variance that of the fits and the reaches.  Both are multiplied by
    1 - variance / height^2 at d = 0, or by 0 (James and Stein 1961), since most of a skirt within
    its noise is noise (H4).  All film that moves stands on the skirt at d = 0.

    A skirt that is wide against the film at rest looks like a fall that all film shares.  So the
    difference to the skirt that is found without such a fall is a part of the error, as far as it
    exceeds the deviations of both.

    Parameters
    ----------
    slope, variance : 2 x H x W, relative to the film at rest, and their variances
    rest : H x W, 1 on the film that is held at zero
    misfit : errors of the film's model; its tilt is the standard deviation of the shared fall
    pixel : mm per px

    Returns
    -------
    H x W in mm each; 0 if all film is at rest, or none.
    """
    if rest.all() or not rest.any():
        return Skirt(np.zeros(rest.shape, np.float32), np.zeros(rest.shape, np.float32))
    away = cv2.distanceTransform(rest, cv2.DIST_L2, cv2.DIST_MASK_5)
    held = rest != 0
    across, down = (cv2.Sobel(away, cv2.CV_32F, x, 1 - x, ksize=1, scale=0.5) for x in (1, 0))
    falls = -(slope[0] * across + slope[1] * down)[held]
    weight = 2 / (variance[0] + variance[1])[held]
    away = away[held]
    bins = away.astype(np.intp)
    sums = [np.bincount(bins, each * weight) for each in (np.ones_like(away), away, falls)]
    information, distance, fall = np.asarray(sums, np.float64)[:, sums[0] > 0]
    at = np.arange(bins.max() + 2, dtype=np.float64)
    px_mm = float(pixel)
    measured = px_mm * distance / information, fall / information, information
    tilts = float(misfit[4]), 0.0
    (found, own, share), (alone, other, _) = (_skirt(*measured, px_mm * at, t) for t in tilts)
    beyond = np.maximum(np.square(found - alone) - own - other, 0)
    profiles = found, np.sqrt(share * own + beyond)
    planes = [np.full(rest.shape, each[0], np.float32) for each in profiles]
    for plane, each in zip(planes, profiles, strict=True):
        plane[held] = np.interp(away, at, each)
    return Skirt(*planes)


def _skirt(distance: F8, fall: F8, information: F8, at: F8, tilt: float) -> tuple[F8, F8, float]:
    """The height at some distances, its variance before it is shrunk, and to which share it is.

    Distances in mm; `information` is one over the variance of each fall, `tilt` the standard
    deviation of the fall that all film has.
    """
    reach = np.geomspace(at[1], max(distance[-1], 2 * at[1]), TRIAL_REACHES)[:, None]
    shape = np.exp(-distance / reach)
    steep, both = (shape * shape) @ information, shape @ information
    even = information.sum() + 1 / max(tilt * tilt, MIN_SQUARE)
    of_shape, of_all = shape @ (information * fall), information @ fall
    determinant = steep * even - both * both
    begin = (even * of_shape - both * of_all) / determinant
    tilted = (steep * of_all - both * of_shape) / determinant
    misfit = information @ (fall * fall) - begin * of_shape - tilted * of_all
    excess = max(1.0, misfit.min() / max(distance.size - 2, 1))
    likelihood = np.exp((misfit.min() - misfit) / (2 * excess)) / np.sqrt(determinant)
    likelihood /= likelihood.sum()
    unit = reach * np.exp(-at / reach)
    height = (likelihood * begin) @ unit
    square = (likelihood * (begin * begin + excess * even / determinant)) @ (unit * unit)
    variance = np.maximum(square - height * height, 0)
    share = max(0.0, 1 - variance[0] / max(height[0] ** 2, MIN_SQUARE))
    return share * height, variance, share
