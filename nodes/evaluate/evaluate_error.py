"""Check the stated error of a height against its true error."""

from __future__ import annotations

import numpy as np

from tactograph.graph import node
from tactograph.nodes import BAND_DEVIATIONS, Height, HeightError, Metrics


@node
def evaluate_error(height: Height, error: HeightError, truth: Height | None = None) -> Metrics:
    """Return how much of the truth lies within the 90 % band, or nothing without truth.

    Pixels of stated error zero are left out: there the film is at rest by definition.

    Parameters
    ----------
    height, truth
        H x W in mm.
    error
        H x W, one standard deviation in mm.

    Returns
    -------
    dict
        ``in_90_percent_band`` in per cent; 90 if the errors are right.
    """
    stated = error > 0
    if truth is None or not stated.any():
        return {}
    inside = np.abs(height - truth)[stated] <= BAND_DEVIATIONS * error[stated]
    return {"in_90_percent_band": float(100 * inside.mean())}
