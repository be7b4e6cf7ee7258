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
BLOCK = 16
"""Pixels of a block's side: single places that depart, dirt or an edge, are not the model's."""
USUAL = 0.5
"""Error of a normal by the light that is left, at least: what presses leave may be all noise."""
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
    the model's; the median over blocks of pixels counts.  Normals err in proportion to it, as they
    did on the presses; what the touch leaves beyond those adds to their misfit, as squares.

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
    level, width, pressed, bounce, tilt = (float(v) for v in misfit)
    found = _left(light, slope, height, used, lights, pixel, width)
    if found <= pressed:
        return misfit
    share = max(level / pressed, USUAL) if pressed > 0 else USUAL
    beyond = share**2 * (found**2 - pressed**2)
    wider, tilt = (float(np.sqrt(before**2 + beyond)) for before in (level, tilt))
    if found > CLEARLY * pressed and found > LEAST:
        times = wider / max(level, pressed)
        warn(
            f"the light departs from the film's model by {100 * found:.1f} %, on the "
            f"calibration's presses by {100 * pressed:.1f} %: the model's part of the stated "
            f"error is {times:.1f} times as wide"
        )
    return np.asarray([wider, width, found, bounce, tilt], np.float32)


def _left(
    light: F4, slope: F4, height: F4, used: Labels, lights: F4, pixel: float, width: float
) -> float:
    """The root mean square that neighbours share of what no normal explains."""
    left = light - expected_light(light_vectors(lights, height, pixel), slope)
    counts = (used == (1 << len(lights)) - 1) & (np.hypot(*slope) > TILTED)
    left = np.where(counts, left, np.float32(0))
    lag = max(NEAREST_PX, round(width / pixel / 4))
    here, corner = np.s_[..., :-lag, :-lag], left[..., :-lag, :-lag]
    product = (corner * (left[..., lag:, :-lag] + left[..., :-lag, lag:])).mean(axis=0)
    pairs = counts[here] * (counts[lag:, :-lag].astype(np.float32) + counts[:-lag, lag:])
    total, known = _by_block(product), _by_block(pairs)
    plenty = known > BLOCK * BLOCK
    return float(np.sqrt(max(np.median(total[plenty] / known[plenty]), 0))) if plenty.any() else 0.0


def _by_block(plane: F4) -> F4:
    """The sums over whole blocks."""
    rows, columns = (side // BLOCK for side in plane.shape)
    blocks = plane[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK)
    return np.asarray(blocks.sum(axis=(1, 3)), np.float32)
