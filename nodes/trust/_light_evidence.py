"""What the light of a touch comes to, against the slopes that were found."""

from typing import NamedTuple

import numpy as np

from tactograph.nodes import F4, FULL_MISFIT_SLOPE, Labels, Light, Slope
from tactograph.nodes.trust.checked_cells import MIN_LEDS, quarter_of, thinned
from tactograph.nodes.trust.light_departure import Brighter, Departure

MAX_SQUARED_BEND = np.float32(0.16)
"""`squared_bend` beyond which a cell may hold an edge, whose light is a mean of two normals."""


class LightFigures(NamedTuple):
    """Figures of the light; touched film is steeper than `FULL_MISFIT_SLOPE`."""

    at_rest: float
    """Median departure of the light of film that is not touched."""
    of_touch: float
    """Upper quartile of the departure of the light of touched film."""
    dim: float
    """Lower quartile of the light in shadow, as of a matt film."""
    brighter: float
    """Median of what touched film is brighter than its slopes make it (T4)."""
    dirty: float
    """Cells that lack too much of their light under all LEDs; -1: light is not looked at."""


def light_evidence(
    departure: Departure,
    slope: Slope,
    brighter: Brighter | None = None,
    used: Labels | None = None,
    matt: Light | None = None,
    shadow: Labels | None = None,
    max_dimming: float = 0.3,
) -> LightFigures:
    """Return how far the light departs from what the slopes predict, in figures (T1, T4).

    Where three quarters of the touched film may hold edges, as that of fine gratings, its light is
    not compared.  Figures of fewer than `MIN_CELLS` cells, and of what is not given, are 0.
    """
    bend = thinned(squared_bend(slope))
    departs, (p, q) = thinned(departure), thinned(slope)
    steep, tested = p * p + q * q > FULL_MISFIT_SLOPE * FULL_MISFIT_SLOPE, departs >= 0
    edges, cells = (np.count_nonzero(some) for some in (bend[steep] > MAX_SQUARED_BEND, steep))
    compared = np.bool_(4 * edges <= 3 * cells)
    at_rest, of_touch = departs[tested & ~steep], departs[tested & steep & compared]
    dim = middle = dirty = 0.0
    if matt is not None and shadow is not None:
        dim = quarter_of(_light_in_shadow(thinned(matt), thinned(shadow)), 1)
    if brighter is not None:
        excess = thinned(brighter)
        lit = np.bool_(True) if used is None else np.bitwise_count(thinned(used)) >= MIN_LEDS
        dirty = int((lit & (excess < -np.float32(max_dimming))).sum())
        # Images that are alike show no slope, but film that is dark.
        touched = compared & lit & (steep | (np.abs(excess) > FULL_MISFIT_SLOPE))
        middle = quarter_of(excess[touched], 2)
    rest, upper = np.sqrt([quarter_of(at_rest, 2), quarter_of(of_touch, 3)])
    return LightFigures(rest, upper, dim, middle, dirty)


def squared_bend(slope: F4) -> F4:
    """Return the squared difference of a cell's slope from those two cells away, H x W."""
    bend = np.zeros(slope.shape[1:], np.float32)
    across = slope[:, :, 4:] + slope[:, :, :-4] - 2 * slope[:, :, 2:-2]
    down = slope[:, 4:] + slope[:, :-4] - 2 * slope[:, 2:-2]
    bend[:, 2:-2] += (across * across).sum(axis=0)
    bend[2:-2] += (down * down).sum(axis=0)
    return bend


def _light_in_shadow(light: F4, shadow: Labels) -> F4:
    """The mean light of those LEDs that do not reach a cell, where there are any."""
    dark = shadow >> np.arange(len(light), dtype=np.uint8)[:, None, None] & 1
    count = dark.sum(axis=0)
    mean = (light * dark).sum(axis=0) / np.maximum(count, np.float32(1))
    return np.asarray(mean[count > 0], np.float32)
