"""Check the stated error of a height against its true error."""

import cv2
import numpy as np

from tactograph.graph import node
from tactograph.nodes import BAND_DEVIATIONS, UM_PER_MM, Height, HeightError, Mask, Metrics


@node
def evaluate_error(
    height: Height,
    error: HeightError,
    truth: Height | None = None,
    off_rest: HeightError | None = None,
    unresolved: Mask | None = None,
) -> Metrics:
    """Return how much of the truth lies within the 90 % band, or nothing without truth.

    Film at rest is left out, since it would hide the errors stated for a touch.  Unresolved pixels,
    whose height is that of either side of an edge, are left out and counted.

    Parameters
    ----------
    height, truth : H x W in mm
    error : H x W, one standard deviation in mm
    off_rest : H x W, 0 on the film at rest; None: all film counts as touched
    unresolved : H x W, from `unresolved_edges`; None: all pixels count

    Returns
    -------
    dict
        ``in_90_percent_band`` in per cent; 90 if the errors are right.
        ``stated_over_actual``, the ratio of the root mean squares of stated and actual errors.
        ``max_resolved_error_um``, the largest error of these pixels.
        ``unresolved_percent``, the share of touched film that is left out.
    """
    # Resampling by a lens mixes the error of film at rest into the pixels beside it.
    stated = (error if off_rest is None else off_rest) > 0
    touched = cv2.erode(stated.astype(np.uint8), np.ones((3, 3))) != 0
    if truth is None or not touched.any():
        return {}
    counted = touched if unresolved is None else touched & (unresolved == 0)
    figures = {"unresolved_percent": float(100 - 100 * counted.sum() / touched.sum())}
    if not counted.any():
        return figures
    off, deviation = np.abs(height - truth)[counted], error[counted]
    ratio = np.sqrt(np.square(deviation).mean() / max(np.square(off).mean(), 1e-30))
    return {
        "in_90_percent_band": float(100 * (off <= BAND_DEVIATIONS * deviation).mean()),
        "stated_over_actual": float(ratio),
        "max_resolved_error_um": float(UM_PER_MM * off.max()),
        **figures,
    }
