"""The S-L surface of ISO 25178-3: form, short and long wavelengths removed by Gaussian filters."""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt, Interval
from numpy.polynomial.polynomial import polygrid2d, polyvander2d
from scipy.ndimage import gaussian_filter

from tactograph.sdk import F4, Height, InputError, PixelSize, node

GAUSSIAN_ALPHA = np.sqrt(np.log(2) / np.pi)
"""Constant of ISO 16610-61: a Gaussian filter passes half of a wave as long as its nesting
index."""
MAX_FITTED = 100_000
"""Pixels that the form is fitted to; more add nothing."""


class SLSurface(NamedTuple):
    """The S-L surface, and what it was filtered by."""

    height: Height
    metrics: dict[str, float]


@node
def filter_surface(
    height: Height,
    pixel: PixelSize,
    *,
    form_degree: Annotated[int, Interval(ge=0, le=8)] = 1,
    s_filter_mm: Annotated[float, Gt(0)] | None = None,
    l_filter_mm: Annotated[float, Gt(0)] | None = None,
) -> SLSurface:
    """Subtract the form, then waves shorter than the S and longer than the L nesting index.

    The order is ISO 25178-3's: S-filter, F-operation, L-filter.  The Gaussian is that of ISO
    16610-61; at the border and beside unknown film (NaN) its weights are scaled up to one.

    Parameters
    ----------
    height : H x W in mm
    pixel : mm per px
    form_degree
        Degree of the form, a polynomial in x and y fitted by least squares: 0 is the mean, 1 a
        plane, 2 also a ball or a cylinder.
    s_filter_mm, l_filter_mm : nesting indices in mm; None: no filter

    Returns
    -------
    H x W in mm; ``form_degree``, and ``s_filter_mm`` and ``l_filter_mm`` where there is one.

    Raises
    ------
    InputError
        If the S-filter's nesting index is not the smaller one, or too little film is known.
    """
    if s_filter_mm and l_filter_mm and s_filter_mm >= l_filter_mm:
        raise InputError(
            f"`s_filter_mm`={s_filter_mm:g}, `l_filter_mm`={l_filter_mm:g}: the S-filter removes "
            "waves shorter than its index, the L-filter longer ones; give the smaller as "
            "`s_filter_mm`"
        )
    metrics: dict[str, float] = {"form_degree": float(form_degree)}
    if s_filter_mm is not None:
        metrics["s_filter_mm"] = s_filter_mm
        height = gaussian_mean(height, s_filter_mm / pixel)
    flat = height - form(height, form_degree)
    if l_filter_mm is not None:
        metrics["l_filter_mm"] = l_filter_mm
        flat = flat - gaussian_mean(flat, l_filter_mm / pixel)
    return SLSurface(flat, metrics)


def gaussian_mean(height: F4, nesting_px: float) -> F4:
    """The mean weighted by exp(-pi (x / (GAUSSIAN_ALPHA nesting index))^2); NaN stays NaN."""
    sigma = GAUSSIAN_ALPHA * nesting_px / np.sqrt(2 * np.pi)
    is_known = np.isfinite(height)
    shares = gaussian_filter(is_known.astype(float), sigma, mode="constant")
    sums = gaussian_filter(np.where(is_known, height, 0).astype(float), sigma, mode="constant")
    return np.where(is_known, sums / np.maximum(shares, np.finfo(float).tiny), np.nan).astype(
        np.float32
    )


def form(height: F4, degree: int) -> F4:
    """The polynomial in x and y that leaves the least squares of a height map."""
    y, x = np.nonzero(np.isfinite(height))
    terms = (degree + 1) * (degree + 2) // 2
    if len(x) < 10 * terms:
        raise InputError(
            f"{len(x)} known heights are too few for a form of degree {degree} ({terms} terms)"
        )
    every = slice(None, None, max(1, len(x) // MAX_FITTED))
    v, u = (np.linspace(-1, 1, side) for side in height.shape)
    in_degree = np.add.outer(*2 * [np.arange(degree + 1)]) <= degree
    columns = polyvander2d(v[y[every]], u[x[every]], [degree, degree])[:, in_degree.ravel()]
    fitted = np.zeros(in_degree.shape)
    fitted[in_degree] = np.linalg.lstsq(columns, height[y[every], x[every]], rcond=None)[0]
    return polygrid2d(v, u, fitted).astype(np.float32)
