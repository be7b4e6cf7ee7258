"""Check whether the light of a touch is that of any surface."""

import math

from tactograph.nodes.trust._check import MIN_CELLS, Check, worst
from tactograph.nodes.trust._light_evidence import RIM_SHARE, LightFigures

MAX_MEDIAN, MAX_QUARTILE = 2.8, 5.2
"""Departure of the touched film's light, in standard deviations, that right touches stay below."""
MAX_REST = 1.8
"""The same of the median of film at rest."""
MIN_TESTED = 0.5
"""Share of the touched film whose light tests its slope, as on any sensor with rims in shadow."""
MAX_SHADOW_LIGHT = 0.015
"""Light of a matt film in shadow, by the lower quartile of its cells."""
DIRTY_CELLS = 5
"""Cells that lack light under all LEDs from which on they are dirt: right touches have none."""
MAX_BRIGHTNESS, MIN_BRIGHTNESS_ERROR = 1.1, 0.002
"""Median brightness of touched film over its expected error, and the least of that error."""

LIGHT_OF_NO_SURFACE = (
    "the light of the touch is that of no surface under this calibration (check the order of the "
    "images, that all are of this touch and this sensor, and that the camera's gamma, contrast and "
    "white balance are off{0})"
)
COARSE_LIGHT = (
    "the light of the film at rest departs from pixel to pixel (check the exposure, and that the "
    "images are neither compressed nor of fewer gray levels than those of the calibration)"
)
LIT_SHADOWS = (
    "shadows are not dark (keep other light out, or take the calibration and a dark image under it)"
)
# The unit normal that light of two surfaces adds up to is too short: film that is dark under all
# LEDs.  So is that of gamma, of other light, and of images that are alike.
WRONG_BRIGHTNESS = (
    "the touched film is {1} by {2:.1%} than its slopes make it (check that the images show one "
    "touch and that nothing moved, that they are neither blurred nor averaged with others, that "
    "gamma and contrast are off, and that other light is kept out)"
)
ONLY_TWO_LEDS = (
    "only two LEDs light most of the touch, which fits any light (check the exposure, and that no "
    "LED is dead)"
)
DIRTY_FILM = (
    "in places the film is darker under all LEDs than any slope makes it (check the film and the "
    "lens for dirt and hairs)"
)


def check_light(seen: LightFigures, rim_error: float = 0.0, brightness_error: float = 0.0) -> Check:
    """Return the departure of the light from the prediction by the slopes (T1, T4).

    `rim_error` is the error of the light where rims in shadow leave the height uncertain, over
    the model's error; `brightness_error` the standard deviation of the film's brightness.
    """
    shaded = seen.shaded / seen.steep if seen.steep else 0.0
    wider = math.hypot(1, rim_error * min(1.0, shaded / RIM_SHARE))
    brightness = MAX_BRIGHTNESS * math.hypot(brightness_error, MIN_BRIGHTNESS_ERROR)
    excess = abs(seen.brighter)
    figures = {
        LIGHT_OF_NO_SURFACE: max(seen.middle / MAX_MEDIAN, seen.upper / MAX_QUARTILE) / wider,
        COARSE_LIGHT: seen.rest / MAX_REST / wider,
        LIT_SHADOWS: seen.dim / MAX_SHADOW_LIGHT,
        WRONG_BRIGHTNESS: excess / (brightness * wider),
    }
    if seen.steep >= MIN_CELLS:
        figures[ONLY_TWO_LEDS] = MIN_TESTED / max(seen.tested / seen.steep, MIN_TESTED / 10)
    if max(figures.values()) <= 1:  # light that is wrong everywhere is dark in places, too
        figures[DIRTY_FILM] = seen.dirty / DIRTY_CELLS
    rims = "; walls and rims need the graph precise" if shaded > RIM_SHARE else ""
    return worst(figures, rims, "brighter" if seen.brighter > 0 else "darker", excess)
