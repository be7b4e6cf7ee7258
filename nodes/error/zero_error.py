"""State how far the zero of a height may be off, by the film at the border of the frame."""

import math

import numpy as np

from tactograph.graph import node, warn
from tactograph.nodes import (
    FULL_MISFIT_SLOPE,
    Height,
    HeightError,
    Mask,
    PixelSize,
    ZeroError,
    robust_deviation,
)
from tactograph.nodes.light.border import border_of
from tactograph.nodes.light.rest_mask import REST_MARGIN_MM, kept_apart
from tactograph.nodes.slope.height_slopes import height_slopes
from tactograph.nodes.trust.touch_evidence import TouchEvidence

MIN_CALM = 0.2
"""Share of the image at rest below which the height's zero is a guess."""


@node
def zero_error(
    height: Height,
    error: HeightError,
    rest: Mask,
    evidence: TouchEvidence,
    pixel: PixelSize,
) -> ZeroError:
    """Return the standard deviation of the height's zero, the same for all pixels.

    Light shows slopes, so heights are measured from film at rest, which the border of the frame is
    taken to show.  Where a touch leaves none of it, as in a gel that bulges, zero is the border's
    middle, and may be off by as much as film at the border is.  Film held at zero tells better, as
    the mean of as many places as margins (`REST_MARGIN_MM`) fit into its part of the border.  Film
    nearer to the top (or bottom) of the touch than to zero does not count, as it is not taken to be
    at rest, nor film within a margin of slopes of `FULL_MISFIT_SLOPE`, where a touch crosses the
    border.  A touch that reaches all borders may stand as high above film at rest as its own
    height's range.

    A warning is given if no film is at rest, and zero is less certain than the height otherwise is.

    Parameters
    ----------
    height : H x W in mm, above the film at rest
    error : H x W in mm, from `height_error`
    rest : H x W, 1 on the film at rest
    evidence : the figures of `touch_evidence`
    pixel : mm per px

    Returns
    -------
    In mm.
    """
    border, held = np.abs(border_of(height, 1)), border_of(rest, 1) != 0
    flat = np.hypot(*height_slopes(height, pixel).slope) <= FULL_MISFIT_SLOPE
    clear = border_of(kept_apart(flat.astype(np.uint8), REST_MARGIN_MM, pixel), 1) != 0
    loose = border[(2 * border <= np.ptp(height)) & ~held & clear]
    places = max(1.0, held.sum() * float(pixel) / REST_MARGIN_MM)
    off = float(robust_deviation(loose)) / math.sqrt(places) if loose.size else 0.0
    film = evidence.read()
    if film.calm < MIN_CALM:
        off = max(off, film.highest - film.lowest)
    if not rest.any() and off > np.median(border_of(error, 1)):
        warn(
            "no film in the frame is at rest: heights are relative to the middle of its border, "
            f"whose height has a standard deviation of {1e3 * off:.2g} um (the stated error "
            "includes that)"
        )
    return off
