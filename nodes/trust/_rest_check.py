"""Check whether the film at rest of a touch is that of the calibration."""

from __future__ import annotations

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes.light.film_drift import Drift, drift_gain
from tactograph.nodes.trust._check import Check

CALM = np.float32(0.03)
"""Departure of the light that still counts as film at rest."""
MIN_CALM = 0.2
"""Share of the image at rest."""
DARK, MAX_DARK = np.float32(0.05), 0.02
"""Light that counts as none, and the share of the image without any."""
MAX_LEVEL, MAX_SPREAD, MAX_SHAPE = 0.1, 0.08, 0.045
"""Change of an LED's light, half the range of the LEDs' changes, and change across the image."""
MAX_DEPTH, MIN_HEIGHT_MM = 0.6, 0.05
"""Depth below the film at rest, over the greatest height or this height if that is less."""


def check_rest(light: F4, drift: Drift | None, height: F4) -> Check:
    """Return how far the film at rest is from that of the flat frame.

    Parameters
    ----------
    light
        K x h x w, relative to the flat frame, before any drift is taken out.
    drift
        K x 6, as `film_drift` found it; None: no drift is taken out.
    height
        H x W in mm.
    """
    dark = float((light < DARK).all(axis=0).mean())
    if drift is not None and (drift[:, 0] != 1).any():
        level, shape = drift[:, 0], float(np.abs(drift[:, 1:]).max())
        light = light / drift_gain(drift, (light.shape[1], light.shape[2]))
    else:
        level, shape = _border(light), 0.0
        light = np.asarray(light / np.maximum(level, DARK)[:, None, None], np.float32)
    calm = float((np.abs(light - 1) < CALM).all(axis=0).mean())
    change = level - 1
    worst = int(np.abs(change).argmax())
    sense = "brighter" if change[worst] > 0 else "darker"
    named = f"LED {worst + 1} is {sense} than in the calibration"
    checks = [
        Check(abs(float(change[worst])) / MAX_LEVEL, f"{named} (check exposure, gain and LED)"),
        Check(
            float(np.ptp(change)) / 2 / MAX_SPREAD,
            f"{named}, and the others are not (check the LED; if the touch reaches all borders, "
            "the height's tilt is unknown)",
        ),
        Check(
            shape / MAX_SHAPE,
            "the light of the film at rest is spread otherwise than in the calibration (check the "
            "order of the images, and that other light is kept out)",
        ),
        Check(
            dark / MAX_DARK,
            "parts of the image are without light (crop the images to the film, in the calibration "
            "too, and check that frames are whole)",
        ),
        Check(
            MIN_CALM / max(calm, MIN_CALM / 10),
            "hardly any film is at rest, so that zero and tilt of the height are unknown (a touch "
            "that reaches all borders, another sensor, or other light)",
        ),
        Check(
            -float(height.min()) / max(float(height.max()), MIN_HEIGHT_MM) / MAX_DEPTH,
            "most of the touch lies below the film at rest (check the order of the images, and "
            "that they are not turned)",
        ),
    ]
    return max(checks, key=lambda check: check.figure)


def _border(light: F4) -> F4:
    """The median of each LED's light along the border of the image."""
    sides = light[:, 0], light[:, -1], light[:, :, 0], light[:, :, -1]
    return np.asarray(np.median(np.concatenate(sides, axis=1), axis=1), np.float32)
