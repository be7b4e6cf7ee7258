"""Check the stated error of a height against its true error."""

import numpy as np

from tactograph.graph import node
from tactograph.nodes import BAND_DEVIATIONS, UM_PER_MM, Height, HeightError, Mask, Metrics


@node
def evaluate_error(
    height: Height,
    error: HeightError,
    truth: Height | None = None,
    unresolved: Mask | None = None,
) -> Metrics:
    """Return how much of the truth lies within the 90 % band, or nothing without truth.

    Pixels of stated error zero are left out: there the film is at rest by definition.  So are
    unresolved ones, whose height is that of either side of an edge; they are counted.

    Parameters
    ----------
    height, truth : H x W in mm
    error : H x W, one standard deviation in mm
    unresolved : H x W, as `unresolved_edges` gives it; without it all pixels count

    Returns
    -------
    dict
        ``in_90_percent_band`` in per cent; 90 if the errors are right.
        ``stated_over_actual``, the root mean squares of stated and actual errors, divided.
        ``max_resolved_error_um``, the largest error of these pixels.
        ``unresolved_percent``, of the pixels with a stated error, how many are left out.
    """
    stated = error > 0
    if truth is None or not stated.any():
        return {}
    unjudged = stated & (np.bool_(False) if unresolved is None else unresolved != 0)
    figures = {"unresolved_percent": float(100 * unjudged.sum() / stated.sum())}
    counted = stated & ~unjudged
    if not counted.any():
        return figures
    off, deviation = np.abs(height - truth)[counted], error[counted]
    inside = off <= BAND_DEVIATIONS * deviation
    ratio = np.sqrt(np.square(deviation).mean() / max(np.square(off).mean(), 1e-30))
    return {
        "in_90_percent_band": float(100 * inside.mean()),
        "stated_over_actual": float(ratio),
        "max_resolved_error_um": float(UM_PER_MM * off.max()),
        **figures,
    }
