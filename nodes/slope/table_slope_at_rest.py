"""The slopes that the look-up tables give for a film at rest that is not a plane."""

import numpy as np

from tactograph.graph import node
from tactograph.nodes import U1, Light, Reflectance, Slope, Tables
from tactograph.nodes.slope.index_lut import index_lut
from tactograph.nodes.slope.lut_nearest import lut_nearest
from tactograph.nodes.slope.refine_taylor import refine_taylor


@node
def table_slope_at_rest(
    tables: Tables, reflectance: Reflectance, share: Light | None = None
) -> Slope | None:
    """Return the slopes of the film at rest as the paper's flow finds them; None for a plane.

    The tables hold where the calibration's balls were.  Near LEDs light other places from other
    directions, so the tables err there, even for untouched film.  On a plane the flat frame cancels
    that error.  On any other film the slopes of a touch contain it, and subtracting these slopes,
    which contain the same error, removes it.

    Parameters
    ----------
    tables : N x K, N x 2 and N
    reflectance : K x 9, the coefficients of `fit_reflectance`
    share : K x H x W, r of `untouched_film`; None: the film at rest is a plane
    """
    if share is None:
        return None
    lit: U1 = np.zeros(share.shape[1:], np.uint8)
    coarse = lut_nearest(share, lit, index_lut(*tables))
    return refine_taylor(share, coarse, lit, reflectance)
