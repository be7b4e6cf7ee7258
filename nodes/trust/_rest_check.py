"""Check whether the film at rest of a touch is that of the calibration."""

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes.trust._check import Check, worst
from tactograph.nodes.trust._rest_evidence import FilmFigures, RestLevel

MIN_CALM = 0.2
"""Share of the image at rest."""
MAX_DARK_SHARE = 0.02
"""Share of the image without any light."""
MAX_LEVEL, MAX_SPREAD, MAX_SHAPE = 0.1, 0.08, 0.045
"""Change of an LED's light, half the range of the LEDs' changes, and change across the image."""
MAX_KEPT_LEVEL = 0.04
"""Change of an LED's light where no drift is taken out; heights change by three times as much."""
MAX_DEPTH, MIN_HEIGHT_MM = 0.6, 0.15
"""Depth below the film at rest, over the greatest height or this height if that is less."""
MAX_TILT, MIN_EXPLAINED, FLAT_MM = 0.042, 0.99, 0.05
"""Half the range of changes that a tilt of the film would explain to this share, where nothing
stands out by this height."""
MAX_ADDED = 0.02
"""Other light over that of the film at rest."""

ONE_LED_CHANGED = (
    "LED {0} is {1} than in the calibration (check exposure, gain and LED, and that other light is "
    "kept out)"
)
LEDS_CHANGED_APART = (
    "LED {0} is {1} than in the calibration, and the others are not (check the LED; if the touch "
    "reaches all borders, the height's tilt is unknown)"
)
ANOTHER_SPREAD = (
    "the light of the film at rest is spread otherwise than in the calibration (check the order of "
    "the images, and that other light is kept out)"
)
DARK_PARTS = (
    "parts of the image are without light (crop the images to the film, in the calibration too, "
    "and check that frames are whole)"
)
NO_FILM_AT_REST = (
    "hardly any film is at rest, so that zero and tilt of the height are unknown (an object that "
    "fills the frame is for reconstruct_filled; or another sensor or light)"
)
HEIGHT_BELOW_REST = (
    "most of the touch lies below the film at rest (check the order of the images, and that they "
    "are not turned)"
)
ADDED_LIGHT = (
    "{2}, the same everywhere (keep other light out of touch and flat frame; or the camera's black "
    "level has changed)"
)
TILTED_FILM = (
    "the LEDs changed as if the whole film was tilted (a touch that reaches all borders has no "
    "known zero and tilt; if nothing touches, check the LEDs)"
)


def check_rest(
    level: RestLevel, film: FilmFigures, lights: F4 | None = None, added: float = 0.0
) -> Check:
    """Return the departure of film at rest from the flat frame (T3 of ``docs/model.md``).

    `lights`, K x 3 in mm, serve to look for a tilt of the film; `added` is what `added_light`
    found.
    """
    change = [lit - 1 for lit in level.tolist()]
    lowest, highest = min(change), max(change)
    most = highest if highest > -lowest else lowest
    keeps = not film.levelled and film.dark <= MAX_DARK_SHARE
    figures = {
        ONE_LED_CHANGED: abs(most) / (MAX_KEPT_LEVEL if keeps else MAX_LEVEL),
        LEDS_CHANGED_APART: (highest - lowest) / 2 / MAX_SPREAD,
        ANOTHER_SPREAD: film.shape / MAX_SHAPE,
        DARK_PARTS: film.dark / MAX_DARK_SHARE,
        NO_FILM_AT_REST: MIN_CALM / max(film.calm, MIN_CALM / 10),
        HEIGHT_BELOW_REST: -film.lowest / max(film.highest, MIN_HEIGHT_MM) / MAX_DEPTH,
        ADDED_LIGHT: abs(added) / MAX_ADDED,
    }
    if lights is not None and film.highest - film.lowest < FLAT_MM:
        figures[TILTED_FILM] = _tilt(level - 1, lights)
    led, sense = change.index(most) + 1, "brighter" if most > 0 else "darker"
    other = "other light was added to the touch" if added > 0 else "the touch lacks light"
    return worst(figures, led, sense, other)


def _tilt(change: F4, lights: F4) -> float:
    """Return how far the LEDs changed as a tilt of the whole film changes them."""
    towards = lights[:, :2] / lights[:, 2:]
    design = np.column_stack([np.ones(len(lights)), towards])
    tilt = np.linalg.lstsq(design, change, rcond=None)[0][1:]
    tilted, varied = towards @ tilt, change - change.mean()
    explained = float(np.square(tilted - tilted.mean()).sum() / max(np.square(varied).sum(), 1e-12))
    return float(np.ptp(tilted)) / 2 / MAX_TILT if explained > MIN_EXPLAINED else 0.0
