"""Transfer the light of a calibration's tables to another film."""

import numpy as np

from tactograph.sdk import Film, node
from tactograph.sdk.unstable import LutLight, LutLit, LutSlope, TablePixels, predict

MIN_PREDICTED_LIGHT = 0.05
"""Light predicted for the old film above which the ratio of both films is used."""


@node
def carry_tables(
    lut_light: LutLight,
    lut_slope: LutSlope,
    lut_lit: LutLit,
    old: Film,
    new: Film,
) -> TablePixels:
    """Return the tables' pixels with the light that their slopes have on the new film.

    The light of each pixel is multiplied by the ratio of both films' predictions (`optics/film`,
    equation F1) for its slope in the middle of the film.  So the residual of the old model is
    kept.

    Parameters
    ----------
    lut_light, lut_slope, lut_lit : N x K, N x 2 and N: the tables of the old calibration
    old, new : the films; if they are equal, the light does not change by a bit

    Returns
    -------
    Light K x 1 x N, slope 2 x 1 x N, a mask of ones and the LEDs that reach each pixel.
    """
    p, q = lut_slope.T.astype(np.float64)
    normal = np.stack([-p, -q, np.ones_like(p)]) / np.sqrt(1 + p * p + q * q)
    none = np.zeros_like(p)
    height = np.full_like(p, old.contact)
    then, now = (predict(film, normal, none, none, height) for film in (old, new))
    ratio = np.where(then > MIN_PREDICTED_LIGHT, now / np.maximum(then, MIN_PREDICTED_LIGHT), 1)
    return TablePixels.of(lut_light.T * ratio, np.ascontiguousarray(lut_slope.T), lut_lit)
