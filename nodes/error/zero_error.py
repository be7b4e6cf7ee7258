"""State how far the zero of a height may be off, by the film at the border of the frame."""

import numpy as np

from tactograph.graph import node, warn
from tactograph.nodes import (
    BAND_DEVIATIONS,
    Height,
    HeightError,
    Mask,
    ZeroError,
    robust_deviation,
)
from tactograph.nodes.height.rest_at_border import border_of
from tactograph.nodes.trust.touch_evidence import TouchEvidence

MIN_CALM = 0.2
"""Share of the image at rest below which the height's zero is a guess."""


@node
def zero_error(
    height: Height, error: HeightError, rest: Mask, evidence: TouchEvidence
) -> ZeroError:
    """Return the standard deviation of the height's zero, the same for all pixels.

    Light shows slopes, so heights are measured from film at rest, which the border of the frame is
    taken to show.  Where a touch leaves none of it, as in a gel that bulges, zero is a guess, and
    film at the border lies elsewhere: by as much as it does, zero may be off.  More than half of
    the border held at zero makes zero known.  Film nearer to the top (or bottom) of the touch than
    to zero does not count, as it is not taken to be at rest.  A touch that reaches all borders may
    stand as high above film at rest as its own height's range.

    A warning is given if no film is at rest, and the error exceeds that of the border's height.

    Parameters
    ----------
    height : H x W in mm, above the film at rest
    error : H x W in mm, from `height_error`
    rest : H x W, 1 on the film at rest
    evidence : the figures of `touch_evidence`

    Returns
    -------
    In mm.
    """
    border = np.abs(border_of(height, 1))
    off = float(robust_deviation(border[2 * border <= np.ptp(height)]))
    film = evidence.read()
    if film.calm < MIN_CALM:
        off = max(off, film.highest - film.lowest)
    if not rest.any() and off > BAND_DEVIATIONS * np.median(border_of(error, 1)):
        warn(
            "no film in the frame is at rest: heights are relative to the middle of its border, "
            f"which may be off by {1e3 * BAND_DEVIATIONS * off:.2g} um (the stated error includes "
            "that)"
        )
    return off
