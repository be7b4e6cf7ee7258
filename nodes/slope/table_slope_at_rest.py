"""The slopes that tables of a ball find of the film at rest, where that is no plane."""

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
    """Return the slopes of the film at rest as the paper's flow finds them; None on a plane.

    Tables hold for the places of the balls.  Near LEDs light other places from other directions,
    so tables err there, even on the untouched film: on a plane their error at rest is zero by the
    flat frame, on any other film it is that of these slopes, which a touch has as well.

    Parameters
    ----------
    tables : N x K, N x 2 and N
    reflectance : K x 9, as `fit_reflectance` gives it
    share : K x H x W, r as `untouched_film` returns it; None: the film at rest is a plane
    """
    if share is None:
        return None
    lit: U1 = np.zeros(share.shape[1:], np.uint8)
    coarse = lut_nearest(share, lit, index_lut(*tables))
    return refine_taylor(share, coarse, lit, reflectance)
