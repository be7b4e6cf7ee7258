"""The outcome of one check of a touch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tactograph.nodes import F4

NOT_TESTED = np.float32(-1)
"""Value of a map where it tests nothing."""
MIN_CELLS = 20
"""Fewer cells tell nothing of a touch."""
MIN_LEDS = 3
"""Two LEDs fit any light, so that their slope may be any."""


class Check(NamedTuple):
    """Evidence against a touch, and its possible cause."""

    figure: float
    """0: nothing; 1: the limit that right touches stay below."""
    cause: str = ""
    """Observation and remedy, for a message."""


def spread_of(squares: F4) -> tuple[float, float]:
    """Return the roots of the median and of the upper quartile; zeros for too few numbers."""
    if squares.size < MIN_CELLS:
        return 0.0, 0.0
    middle, upper = squares.size // 2, 3 * squares.size // 4
    ordered = np.partition(squares, (middle, upper))
    return float(np.sqrt(ordered[middle])), float(np.sqrt(ordered[upper]))
