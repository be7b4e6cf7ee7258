"""Check whether the film at rest of a touch is that of the calibration."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes.light.film_drift import Drift, border_level, drift_gain
from tactograph.nodes.trust._check import Check

CALM_DEPARTURE = np.float32(0.03)
"""Departure of the light that still counts as film at rest."""
MIN_CALM = 0.2
"""Share of the image at rest."""
DARK_LIGHT, MAX_DARK_SHARE = np.float32(0.05), 0.02
"""Light that counts as none, and the share of the image without any."""
MAX_LEVEL, MAX_SPREAD, MAX_SHAPE = 0.1, 0.08, 0.045
"""Change of an LED's light, half the range of the LEDs' changes, and change across the image."""
MAX_KEPT_LEVEL = 0.04
"""Change of an LED's light where no drift is taken out; heights change by three times as much."""
MAX_DEPTH, MIN_HEIGHT_MM = 0.6, 0.15
"""Depth below the film at rest, over the greatest height or this height if that is less."""
MAX_TILT, MIN_EXPLAINED, FLAT_MM = 0.042, 0.99, 0.05
"""Half the range of changes that a tilt of the film would explain to this share, where nothing
stands out by this height."""

MAX_ADDED, MIN_ADDED_EXPLAINED = 0.02, 0.7
"""Other light over that of the film at rest, where it explains this share of the light's changes
beside each LED's own."""
ADDED_ROUNDS, ADDED_NOISE = 10, 1e-3
"""Rounds of robust least squares, and departure of the light that counts as noise."""


class Rest(NamedTuple):
    """The light without the LEDs' drift, and the share of it that is at rest."""

    level: F4
    """K, each LED's light on the film at rest."""
    shape: float
    """Greatest change of the light across the image."""
    calm: float
    """Share of the image at rest."""


def find_rest(light: F4, drift: Drift | None) -> Rest:
    """Return the film at rest in light of the touch, K x h x w relative to the flat frame."""
    if drift is not None and (drift[:, 0] != 1).any():
        level, shape = drift[:, 0], float(np.abs(drift[:, 1:]).max())
        light = light / drift_gain(drift, (light.shape[1], light.shape[2]))
    else:
        level, shape = border_level(light), 0.0
        light = np.asarray(light / np.maximum(level, DARK_LIGHT)[:, None, None], np.float32)
    return Rest(level, shape, float((np.abs(light - 1) < CALM_DEPARTURE).all(axis=0).mean()))


def check_rest(
    light: F4,
    drift: Drift | None,
    height: F4,
    lights: F4 | None = None,
    flat: F4 | None = None,
) -> Check:
    """Return the departure of film at rest from the flat frame (T3 of ``docs/model.md``).

    Parameters
    ----------
    light
        K x h x w, relative to the flat frame, before any drift is taken out.
    drift
        K x 6, as `film_drift` found it; None: no drift is taken out, so less of it is right.
    height
        H x W in mm.
    lights
        K x 3 in mm; None: a tilt of the film is not looked for.
    flat
        K x h x w, the film at rest; None: light that was added is not looked for.
    """
    dark = float((light < DARK_LIGHT).all(axis=0).mean())
    level, shape, calm = find_rest(light, drift)
    change = level - 1
    worst = int(np.abs(change).argmax())
    sense = "brighter" if change[worst] > 0 else "darker"
    most = MAX_KEPT_LEVEL if drift is None and dark <= MAX_DARK_SHARE else MAX_LEVEL
    named = f"LED {worst + 1} is {sense} than in the calibration"
    checks = [
        Check(
            abs(float(change[worst])) / most,
            f"{named} (check exposure, gain and LED, and that other light is kept out)",
        ),
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
            dark / MAX_DARK_SHARE,
            "parts of the image are without light (crop the images to the film, in the calibration "
            "too, and check that frames are whole)",
        ),
        Check(
            MIN_CALM / max(calm, MIN_CALM / 10),
            "hardly any film is at rest, so that zero and tilt of the height are unknown (an "
            "object that fills the frame is for reconstruct_filled; or another sensor or light)",
        ),
        Check(
            -float(height.min()) / max(float(height.max()), MIN_HEIGHT_MM) / MAX_DEPTH,
            "most of the touch lies below the film at rest (check the order of the images, and "
            "that they are not turned)",
        ),
    ]
    if lights is not None and float(np.ptp(height)) < FLAT_MM:
        checks.append(_tilt(change, lights))
    if flat is not None:
        checks.append(_added(light, flat))
    return max(checks, key=lambda check: check.figure)


def _tilt(change: F4, lights: F4) -> Check:
    """Return whether the LEDs changed as a tilt of the whole film changes them."""
    towards = lights[:, :2] / lights[:, 2:]
    design = np.column_stack([np.ones(len(lights)), towards])
    tilt = np.linalg.lstsq(design, change, rcond=None)[0][1:]
    tilted, varied = towards @ tilt, change - change.mean()
    explained = float(np.square(tilted - tilted.mean()).sum() / max(np.square(varied).sum(), 1e-12))
    figure = float(np.ptp(tilted)) / 2 / MAX_TILT if explained > MIN_EXPLAINED else 0.0
    return Check(
        figure,
        "the LEDs changed as if the whole film was tilted (a touch that reaches all borders has no "
        "known zero and tilt; if nothing touches, check the LEDs)",
    )


def _added(light: F4, flat: F4) -> Check:
    """Return whether the same light was added everywhere: dim film departs more than bright."""
    seen = light.reshape(len(light), -1).astype(np.float64)
    by_added = 1 / np.maximum(flat.reshape(len(flat), -1), DARK_LIGHT).astype(np.float64)
    weight = np.ones(seen.shape[1])
    for _ in range(ADDED_ROUNDS):
        shape, change = (a - np.average(a, 1, weight)[:, None] for a in (by_added, seen))
        square = np.average((shape * shape).mean(axis=0), weights=weight)
        added = np.average((shape * change).mean(axis=0), weights=weight) / max(square, 1e-12)
        left = np.square(change - added * shape).mean(axis=0)
        noise = 1.4826**2 * np.median(left) + ADDED_NOISE**2
        weight = 1 / (1 + left / noise) ** 2
    explained = added**2 * square
    known = explained > MIN_ADDED_EXPLAINED * (explained + np.average(left, weights=weight))
    share = abs(float(added)) * float(np.average(by_added.mean(axis=0), weights=weight))
    cause = "other light was added to the touch" if added > 0 else "the touch lacks light"
    return Check(
        share / MAX_ADDED if known else 0.0,
        f"{cause}, the same everywhere (keep other light out of touch and flat frame; or the "
        "camera's black level has changed)",
    )
