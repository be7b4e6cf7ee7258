"""Residual flatness: the height that a sensor finds of film on which nothing lies."""

import numpy as np

from tactograph.rings.metrology.nodes.certify.measure_touches import Heights
from tactograph.sdk import node


@node
def flatness_deviation(height: Heights | None = None) -> dict[str, float]:
    """Return how far a flat is from flat, by the mean of its captures.

    ISO 25178-600: flatness deviation is Sz of a flat.  The mean of N captures leaves 1 / N of the
    noise's variance, which differences of neighbours tell and which is taken off.

    Parameters
    ----------
    height : N x H x W in mm, of the untouched film; None: it was not captured again

    Returns
    -------
    dict
        ``flatness_deviation_um``, from the lowest to the highest point, and ``flatness_rms_um``.
    """
    if height is None:
        return {}
    maps = 1e3 * height.astype(np.float64)
    flat = np.nanmean(maps, axis=0)
    square = float(np.nanvar(flat))
    if len(maps) > 1:
        square -= float(np.nanmean(np.square(np.diff(maps, axis=0)))) / 2 / len(maps)
    return {
        "flatness_deviation_um": float(np.nanmax(flat) - np.nanmin(flat)),
        "flatness_rms_um": float(np.sqrt(max(square, 0.0))),
    }
