"""The outcome of one check of a touch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tactograph.nodes import F4

UNTESTED = np.float32(-1)
"""Where a map tests nothing."""
MIN_CELLS = 20
"""Fewer cells tell nothing of a touch."""
MIN_LEDS = 3
"""Two LEDs fit any light, so that their slope may be any."""


class Check(NamedTuple):
    """How much speaks against a touch, and what may be the cause."""

    figure: float
    """0: nothing; 1: the limit that right touches stay below."""
    cause: str = ""
    """What is seen, and what to do, for a message."""


def spread_of(squares: F4) -> tuple[float, float]:
    """Return the roots of the median and of the upper quartile; zeros for too few numbers."""
    if squares.size < MIN_CELLS:
        return 0.0, 0.0
    middle, upper = squares.size // 2, 3 * squares.size // 4
    ordered = np.partition(squares, (middle, upper))
    return float(np.sqrt(ordered[middle])), float(np.sqrt(ordered[upper]))
