"""Check whether the light of a touch is that of any surface."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, U1
from tactograph.nodes.trust._check import MIN_CELLS, MIN_LEDS, Check, spread_of
from tactograph.nodes.trust.light_departure import MIN_ERROR

MIN_SLOPE = np.float32(0.1)
"""Film less steep than this is taken to be at rest."""
MAX_MEDIAN, MAX_QUARTILE = 2.8, 5.2
"""Departure of the touched film's light, in standard deviations, that right touches stay below."""
MAX_REST = 1.8
"""The same of the median of film at rest."""
MIN_TESTED = 0.5
"""Share of the touched film whose light tests its slope, as on any sensor with rims in shadow."""
RIM_SHARE = 0.1
"""Share of the touched film in shadow from which on it has rims."""
MAX_SHADOW_LIGHT, MIN_SHADOWS = 0.015, 50
"""Light of a matt film in shadow, by the lower quartile of at least so many cells."""
MIN_TOUCHED_CHANGE = np.float32(0.12)
"""Departure of an LED's light from 1 from which on film is touched, whatever slope was found."""
MAX_DIMMING, DIRTY_CELLS = np.float32(0.3), 5
"""Share of the light that film may lack under all LEDs, and the cells that lack more from which on
it is dirt: right touches have none."""
MIN_SQUARES = np.float32(1e-6)
"""Sum of squares of light that is divided by."""
MAX_BRIGHTNESS, MIN_BRIGHTNESS_ERROR = 1.1, 0.002
"""Median brightness of touched film over its expected error, and the least of that error."""
MAX_SQUARED_BEND = np.float32(0.08**2)
"""`squared_bend` beyond which a cell of narrow film may hold an edge, and its brightness is not
compared."""
INNER_CELLS, MAX_INNER_SHARE = 5, 0.02
"""Width of film that is not narrow, and the share of such film up to which all is narrow, as the
walls of grooves and letters are..."""
MIN_SQUARED_BEND, MIN_BENT_SHARE = np.float32(0.2**2), 0.85
"""... if this share of it bends by more than this (`squared_bend`)."""
MIN_SQUARED_FOLD, MIN_FOLDED_SHARE = np.float32(0.4**2), 0.8
"""The same of film that is narrow however it lies: gratings with lines of a few cells."""
BEND_ERROR = np.float32(1 / 12)
"""Error of the light of a cell that may hold an edge, over that square: a mean of two normals is
short."""

LIGHT_CURE = (
    "check the order of the images, that all are of this touch and this sensor, and that the "
    "camera's gamma, contrast and white balance are off"
)


class Touched(NamedTuple):
    """Inputs of `check_light`: the film, its light and its labels."""

    departure: F4
    """H x W, as `light_departure` gives it."""
    slope: F4
    """2 x H x W."""
    used: U1 | None
    """H x W, the LEDs that each slope rests on; None: all."""
    light: F4 | None
    """K x H x W, as of a matt film."""
    shadow: U1 | None
    """H x W, the LEDs that do not light a pixel."""
    shown: F4 | None = None
    """K x H x W, the light of matt film under the slopes that were found."""
    bend: F4 | None = None
    """H x W, as `squared_bend` gives it."""


def squared_bend(slope: F4) -> F4:
    """Return the squared difference of a cell's slope from those two cells away, H x W."""
    bend = np.zeros(slope.shape[1:], np.float32)
    across = slope[:, :, 4:] + slope[:, :, :-4] - 2 * slope[:, :, 2:-2]
    down = slope[:, 4:] + slope[:, :-4] - 2 * slope[:, 2:-2]
    bend[:, 2:-2] += (across * across).sum(axis=0)
    bend[2:-2] += (down * down).sum(axis=0)
    return bend


def check_light(
    touched: Touched,
    count: int,
    rim_error: float,
    brightness_error: float = 0.0,
    error: float = MIN_ERROR,
) -> Check:
    """Return the departure of the light of K LEDs from the prediction by the slopes (T1, T4).

    `rim_error` is the error of the light where rims in shadow leave the height uncertain, over
    the model's error; `brightness_error` the standard deviation of the film's brightness, and
    `error` that of the model's light.
    """
    steep = (touched.slope * touched.slope).sum(axis=0) > MIN_SLOPE * MIN_SLOPE
    tested, cells = touched.departure >= 0, int(np.count_nonzero(steep))
    shaded = 0.0
    if touched.used is not None and cells:
        shaded = int(np.count_nonzero(touched.used[steep] != (1 << count) - 1)) / cells
    # Walls that shade film are doubted, not left out: beside them the height is wrong.
    is_even = shaded > RIM_SHARE or touched.bend is None or not _is_narrow(steep, touched.bend)
    if is_even:
        touched = touched._replace(bend=None)
    wider = float(np.hypot(1, rim_error * min(1.0, shaded / RIM_SHARE)))
    rest, _ = spread_of(touched.departure[tested & ~steep])
    middle, upper = spread_of(_departure(touched, error)[tested & steep])
    rims = "; walls and rims need the graph precise" if shaded > RIM_SHARE else ""
    brightness, dirt = _brightness(touched, brightness_error, wider)
    checks = [
        Check(
            max(middle / MAX_MEDIAN, upper / MAX_QUARTILE) / wider,
            "the light of the touch is that of no surface under this calibration "
            f"({LIGHT_CURE}{rims})",
        ),
        Check(
            rest / MAX_REST / wider,
            "the light of the film at rest departs from pixel to pixel (check the exposure, and "
            "that the images are neither compressed nor of fewer gray levels than those of the "
            "calibration)",
        ),
        _shadows(touched, count),
        brightness,
    ]
    if cells >= MIN_CELLS:
        share = int(np.count_nonzero(steep & tested)) / cells
        checks.append(
            Check(
                MIN_TESTED / max(share, MIN_TESTED / 10),
                "only two LEDs light most of the touch, which fits any light (check the exposure, "
                "and that no LED is dead)",
            )
        )
    worst = max(checks, key=lambda check: check.figure)
    # Light that is wrong everywhere is dark in places, too.
    return worst if worst.figure > 1 else max(worst, dirt, key=lambda check: check.figure)


def _shadows(touched: Touched, count: int) -> Check:
    """Return whether it is dark where an LED does not reach."""
    if touched.light is None or touched.shadow is None:
        return Check(0.0)
    lit = [touched.light[k][touched.shadow >> k & 1 == 1] for k in range(count)]
    light = np.concatenate(lit)
    if light.size < MIN_SHADOWS:
        return Check(0.0)
    lower = float(np.partition(light, light.size // 4)[light.size // 4])
    return Check(
        lower / MAX_SHADOW_LIGHT,
        "shadows are not dark (keep other light out, or take the calibration and a dark image "
        "under it)",
    )


def _brightness(touched: Touched, error: float, wider: float) -> tuple[Check, Check]:
    """Return whether the touched film is as bright as its slopes say, and whether none is dirty.

    The unit normal that light of two surfaces adds up to is too short: film that is dark under all
    LEDs.  So is that of gamma, of other light, and of images that are alike.  Dirt is dark, too.
    """
    light, shown, used = touched.light, touched.shown, touched.used
    if light is None or shown is None or used is None:
        return Check(0.0), Check(0.0)
    bits = np.arange(len(light), dtype=np.uint8)[:, None, None]
    lit = (used >> bits & 1).astype(np.float32)
    weight = shown * lit
    seen, due = (np.einsum("khw,khw->hw", each, weight) for each in (light, shown))
    tested = lit.sum(axis=0) >= MIN_LEDS
    brighter = seen / np.maximum(due, MIN_SQUARES) - 1
    dirty = int(np.count_nonzero(tested & (brighter < -MAX_DIMMING)))
    dirt = Check(
        dirty / DIRTY_CELLS,
        "in places the film is darker under all LEDs than any slope makes it (check the film and "
        "the lens for dirt and hairs)",
    )
    touched_film = tested & (np.abs(light - 1).max(axis=0) > MIN_TOUCHED_CHANGE)
    if touched.bend is not None:
        touched_film &= touched.bend < MAX_SQUARED_BEND
    brighter = brighter[touched_film]
    if brighter.size < MIN_CELLS:
        return Check(0.0), dirt
    middle = float(np.median(brighter))
    sense = "brighter" if middle > 0 else "darker"
    brightness = Check(
        abs(middle) / (MAX_BRIGHTNESS * float(np.hypot(error, MIN_BRIGHTNESS_ERROR)) * wider),
        f"the touched film is {sense} by {abs(middle):.1%} than its slopes make it (check that the "
        "images show one touch and that nothing moved, that they are neither blurred nor averaged "
        "with others, that gamma and contrast are off, and that other light is kept out)",
    )
    return brightness, dirt


def _departure(touched: Touched, error: float) -> F4:
    """Return the departure of the light, less where a cell may hold an edge."""
    if touched.bend is None:
        return touched.departure
    wider = BEND_ERROR / np.float32(error) * touched.bend
    return touched.departure / (1 + wider * wider)


def _is_narrow(steep: NDArray[np.bool_], bend: F4) -> bool:
    """Whether steep film bends so much from cell to cell that its cells may hold edges."""
    cells, bends = np.count_nonzero(steep), bend[steep]
    if np.count_nonzero(bends > MIN_SQUARED_BEND) < MIN_BENT_SHARE * cells:
        return False
    if np.count_nonzero(bends > MIN_SQUARED_FOLD) > MIN_FOLDED_SHARE * cells:
        return True
    inner = cv2.erode(steep.astype(np.uint8), np.ones((INNER_CELLS, INNER_CELLS), np.uint8))
    return bool(np.count_nonzero(inner) <= MAX_INNER_SHARE * cells)
