"""Fit the spherical-harmonic reflectance of every LED."""

from typing import Annotated, NamedTuple

import numpy as np

from tactograph.graph import Port, node
from tactograph.nodes import F4, Labels, Light, Mask, Reflectance, Slope, robust_deviation
from tactograph.nodes.calibrate.tables.build_lut import refuse_few
from tactograph.nodes.optics.gauss_newton import SlopeNormal


class ReflectanceFit(NamedTuple):
    """Nine coefficients per LED, and the standard deviation of their residual."""

    reflectance: Reflectance
    residual: Annotated[F4, Port("K", "1")]


@node
def fit_reflectance(light: Light, slope: Slope, mask: Mask, lit: Labels) -> ReflectanceFit:
    """Fit R(n) = sum of l_nm Y_nm(n) up to second order by least squares (equation 4).

    Parameters
    ----------
    light, slope, mask, lit
        Of the calibration object: K x H x W, 2 x H x W, H x W, H x W.  Each LED is fitted
        on the pixels that it reaches.

    Returns
    -------
    Coefficients K x 9 in the order of `SlopeNormal.harmonics`; the standard deviation of the
    residual, K, by its median, so that a few hot pixels do not spoil it.

    Raises
    ------
    InputError
        If an LED reaches fewer than 100 pixels of the object.
    """
    coefficients, residuals = [], []
    for k, plane in enumerate(light):
        chosen = (mask > 0) & ((lit >> k) & 1 > 0)
        refuse_few(chosen, f"LED {k + 1}", "is it on?")
        basis = SlopeNormal(*slope[:, chosen]).harmonics.T.astype(np.float64)
        harmonic, *_ = np.linalg.lstsq(basis, plane[chosen].astype(np.float64), rcond=None)
        coefficients.append(harmonic)
        residuals.append(robust_deviation(basis @ harmonic - plane[chosen]))
    return ReflectanceFit(np.asarray(coefficients, np.float32), np.asarray(residuals, np.float32))
