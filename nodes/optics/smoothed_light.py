"""Smoothing of light that keeps its trend over the image."""

import numpy as np
from numpy.polynomial.chebyshev import chebgrid2d, chebvander2d
from scipy.ndimage import gaussian_filter

from tactograph.nodes import F4

TREND_DEGREE = 4
"""Degree in x and in y of the trend: vignetting and the fall-off of near light."""
FILM_PERCENTILE, MAX_DARK_SHARE = 95, 0.1
"""Percentile of the light that is taken as the film's; share of it up to which a pixel is dark."""
MAX_FIT_PIXELS = 20000
"""Number of pixels to which a trend is fitted; more add no information."""


def smoothed_light(plane: F4, smooth_px: float) -> F4:
    """Smooth the light of an LED, H x W, by a Gaussian, except for its trend over the film.

    A Gaussian of s px changes light by s^2 / 2 of its Laplacian, and by more at the border.  Of a
    flat frame with vignetting that is some 0.0003, by which film at rest seems to bulge by 1 um.
    The trend is a polynomial, fitted by least squares where the film is not dark.
    """
    y, x = (np.linspace(-1, 1, side) for side in plane.shape)
    film = np.flatnonzero(plane >= MAX_DARK_SHARE * np.percentile(plane, FILM_PERCENTILE))
    film = film[:: 1 + film.size // MAX_FIT_PIXELS]
    row, column = np.divmod(film, plane.shape[1])
    terms = chebvander2d(y[row], x[column], (TREND_DEGREE, TREND_DEGREE))
    coefficients = np.linalg.lstsq(terms, plane.ravel()[film], rcond=None)[0]
    trend = chebgrid2d(y, x, coefficients.reshape(TREND_DEGREE + 1, TREND_DEGREE + 1))
    return np.asarray(trend + gaussian_filter(plane - trend, smooth_px, mode="nearest"), np.float32)
