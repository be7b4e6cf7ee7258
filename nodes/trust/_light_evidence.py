"""What the light of a touch comes to, against the slopes that were found."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, Labels, Light, Misfit, Slope, Uneven
from tactograph.nodes.trust._check import MIN_LEDS, NOT_TESTED, quarter_of, thinned
from tactograph.nodes.trust.light_departure import Brighter, Departure, light_error

MIN_SLOPE = np.float32(0.1)
"""Film less steep than this is taken to be at rest."""
MIN_TOUCHED_CHANGE = np.float32(0.12)
"""Departure of an LED's light from 1 from which on film is touched, whatever slope was found."""
MAX_SQUARED_BEND = np.float32(0.08**2)
"""`squared_bend` beyond which a cell of narrow film may hold an edge, and its brightness is not
compared."""
RIM_SHARE = 0.1
"""Shadowed fraction of the touched film that indicates rims: walls that shade film are doubted,
not left out, since beside them the height is wrong."""
INNER_CELLS, MAX_INNER_SHARE = 5, 0.02
"""Minimum width of a resolved feature in cells, and the share of such film up to which all is
narrow, as the walls of grooves and letters are..."""
MIN_SQUARED_BEND, MIN_BENT_SHARE = np.float32(0.2**2), 0.85
"""... if this share of it bends by more than this (`squared_bend`)."""
MIN_SQUARED_FOLD, MIN_FOLDED_SHARE = np.float32(0.4**2), 0.8
"""The same of film that is narrow however it lies: gratings with lines of a few cells."""
BEND_ERROR = np.float32(1 / 12)
"""Error of the light of a cell that may hold an edge, over that square: a mean of two normals is
short."""


class LightFigures(NamedTuple):
    """Figures of the light of touched film, that is of cells steeper than `MIN_SLOPE`."""

    steep: float
    """Number of such cells; -1 where the light is not looked at."""
    shaded: float
    """How many of them not all LEDs light."""
    tested: float
    """How many of them are tested, be it by dark LEDs alone."""
    rest: float
    """Median departure of the light of the others."""
    middle: float
    """Median departure of the light of such cells."""
    upper: float
    """Its upper quartile."""
    dim: float
    """Lower quartile of the light in shadow, as of a matt film."""
    dirty: float
    """Cells that lack too much of their light under all LEDs."""
    brighter: float
    """Median of what touched film is brighter than its slopes make it (T4)."""


def light_evidence(
    departure: Departure,
    slope: Slope,
    misfit: Misfit,
    uneven: Uneven | None = None,
    brighter: Brighter | None = None,
    used: Labels | None = None,
    matt: Light | None = None,
    shadow: Labels | None = None,
    max_dimming: float = 0.3,
) -> LightFigures:
    """Return how far the light departs from what the slopes predict, in figures (T1, T4).

    Figures of fewer than `MIN_CELLS` cells, and of what is not given, are 0.
    """
    bend = thinned(squared_bend(slope))
    departs, (p, q) = thinned(departure), thinned(slope)
    steep, tested = p * p + q * q > MIN_SLOPE * MIN_SLOPE, departs >= 0
    whole = None if matt is None else (1 << len(matt)) - 1
    shades = steep & (thinned(used) != whole) if used is not None and whole else steep & False
    cells, shaded = int(steep.sum()), int(shades.sum())
    at_rest, of_touch = departs[tested & ~steep], departs[tested & steep]
    narrow = shaded <= RIM_SHARE * cells and _is_narrow(steep, bend)
    if narrow:
        wider = BEND_ERROR / np.float32(light_error(misfit, uneven or 0.0)) * bend
        of_touch = of_touch / (1 + np.square(wider[tested & steep]))
    dim = dirty = middle = 0.0
    if matt is not None and shadow is not None:
        dim = quarter_of(_light_in_shadow(thinned(matt), thinned(shadow)), 1)
    if brighter is not None:
        excess = thinned(brighter)
        lit = np.bool_(True) if used is None else np.bitwise_count(thinned(used)) >= MIN_LEDS
        dirty = int((lit & (excess < -np.float32(max_dimming))).sum())
        if matt is not None:
            lit = lit & (np.abs(thinned(matt) - 1) > MIN_TOUCHED_CHANGE).any(axis=0)
            middle = quarter_of(excess[lit & (bend < MAX_SQUARED_BEND) if narrow else lit], 2)
    spread = (at_rest, 2), (of_touch, 2), (of_touch, 3)
    rest, median, upper = (np.sqrt(quarter_of(*each)) for each in spread)
    known = int((steep & (departs > NOT_TESTED)).sum())
    return LightFigures(cells, shaded, known, rest, median, upper, dim, dirty, middle)


def squared_bend(slope: F4) -> F4:
    """Return the squared difference of a cell's slope from those two cells away, H x W."""
    bend = np.zeros(slope.shape[1:], np.float32)
    across = slope[:, :, 4:] + slope[:, :, :-4] - 2 * slope[:, :, 2:-2]
    down = slope[:, 4:] + slope[:, :-4] - 2 * slope[:, 2:-2]
    bend[:, 2:-2] += (across * across).sum(axis=0)
    bend[2:-2] += (down * down).sum(axis=0)
    return bend


def _is_narrow(steep: NDArray[np.bool_], bend: F4) -> bool:
    """Whether steep film bends so much from cell to cell that its cells may hold edges."""
    cells, bends = np.count_nonzero(steep), bend[steep]
    if np.count_nonzero(bends > MIN_SQUARED_BEND) < MIN_BENT_SHARE * cells:
        return False
    if np.count_nonzero(bends > MIN_SQUARED_FOLD) > MIN_FOLDED_SHARE * cells:
        return True
    inner = cv2.erode(steep.astype(np.uint8), np.ones((INNER_CELLS, INNER_CELLS), np.uint8))
    return bool(np.count_nonzero(inner) <= MAX_INNER_SHARE * cells)


def _light_in_shadow(light: F4, shadow: Labels) -> F4:
    """The mean light of those LEDs that do not reach a cell, where there are any."""
    dark = shadow >> np.arange(len(light), dtype=np.uint8)[:, None, None] & 1
    count = dark.sum(axis=0)
    mean = (light * dark).sum(axis=0) / np.maximum(count, np.float32(1))
    return np.asarray(mean[count > 0], np.float32)
