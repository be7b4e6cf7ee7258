"""How far a touch departs from the film's model, against the presses that it was fitted to."""

from __future__ import annotations

import numpy as np

from tactograph.graph import node, warn
from tactograph.nodes import F4, Height, Labels, Light, LightPositions, Misfit, PixelSize, Slope
from tactograph.nodes.light._near_light import expected_light, light_vectors

TILTED = np.float32(0.1)
"""Slope of film that tells whether the model holds."""
NEAREST_PX = 2
"""The noise of pixels so far apart is independent."""
FEWEST = 1000
"""Pairs of pixels that say anything."""
CLEARLY, LEAST = 2.0, 0.005
"""Times what the calibration left, and light, above which a departure is told."""


@node
def touch_misfit(
    light: Light,
    slope: Slope,
    height: Height,
    used: Labels,
    lights: LightPositions,
    misfit: Misfit,
    pixel: PixelSize,
) -> Misfit:
    """Widen the model's misfit where a touch departs more than the calibration's presses did.

    Three LEDs or more say more than a normal: what no normal explains, and neighbours share, is
    the model's.  It errs in the normals as much as in the light that is left; so what the touch
    leaves beyond the presses adds to the level, as squares.

    Parameters
    ----------
    light
        K x H x W, as of a matt film (`matt_light`).
    slope, used
        2 x H x W and H x W, as `label_lights` found them.
    height
        H x W in mm, as it was known then.
    lights
        K x 3 in mm.
    misfit
        Of the calibration.
    pixel
        mm per px.

    Returns
    -------
    ndarray
        The misfit of this touch.  A warning says so where the light departs clearly more.
    """
    level, width, pressed, bounce = (float(v) for v in misfit)
    found = _left(light, slope, height, used, lights, pixel, width)
    if found <= pressed:
        return misfit
    wider = float(np.sqrt(level**2 + found**2 - pressed**2))
    if found > CLEARLY * pressed and found > LEAST:
        times = wider / max(level, pressed)
        warn(
            f"the light departs from the film's model by {100 * found:.1f} %, on the "
            f"calibration's presses by {100 * pressed:.1f} %: the model's part of the stated "
            f"error is {times:.1f} times as wide"
        )
    return np.asarray([wider, width, found, bounce], np.float32)


def _left(
    light: F4, slope: F4, height: F4, used: Labels, lights: F4, pixel: float, width: float
) -> float:
    """The root mean square that neighbours share of what no normal explains."""
    left = light - expected_light(light_vectors(lights, height, pixel), slope)
    counts = (used == (1 << len(lights)) - 1) & (np.hypot(*slope) > TILTED)
    left = np.where(counts, left, np.float32(0))
    lag = max(NEAREST_PX, round(width / pixel / 4))
    total = pairs = 0.0
    for product, both in (
        (left[:, lag:] * left[:, :-lag], counts[lag:] & counts[:-lag]),
        (left[..., lag:] * left[..., :-lag], counts[:, lag:] & counts[:, :-lag]),
    ):
        total += float(product.sum(dtype=float)) / len(left)
        pairs += float(both.sum())
    return float(np.sqrt(max(total, 0) / pairs)) if pairs >= FEWEST else 0.0
