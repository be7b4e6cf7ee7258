"""The smooth part of an LED's light over an image, and smoothing that keeps it."""

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from scipy.ndimage import gaussian_filter

from tactograph.nodes import F4

TREND_DEGREE = 6
"""Degree of the polynomial that follows vignetting and the fall-off of near light."""


def light_trend(plane: F4) -> F4:
    """Return the least-squares polynomial of an image H x W, of `TREND_DEGREE` in x and in y."""
    down, across = (
        np.linalg.qr(chebvander(np.linspace(-1, 1, side), TREND_DEGREE))[0].astype(np.float32)
        for side in plane.shape
    )
    return np.asarray(down @ (down.T @ plane @ across) @ across.T, np.float32)


def smoothed_light(plane: F4, smooth_px: float) -> F4:
    """Smooth an image H x W by a Gaussian, except for its trend.

    A Gaussian of s px changes light by s^2 / 2 of its Laplacian, and by more at the border.  Of a
    flat frame with vignetting that is some 0.0003, a dome of 1 um over the film at rest.
    """
    trend = light_trend(plane)
    return np.asarray(trend + gaussian_filter(plane - trend, smooth_px, mode="nearest"), np.float32)
