"""Say what a new film has changed, what is left, and whether a full calibration is due."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from tactograph.graph import Port, node
from tactograph.nodes import F4, Height, Metrics, PixelSize

REFERENCES = "film_heldout_deg", "heldout_normal_deg"
"""Errors of a full calibration on presses held out, in degrees, by kind."""
WORSE = 1.5
"""Times the full calibration's error, ..."""
GOOD = 0.5
"""... but at least so many degrees, from which another full calibration is due."""
THICKER = 1.0
"""mm that the gel may differ by: beyond, an LED's light reaches the film otherwise."""
UNEVEN = 0.2
"""Share by which LEDs may differ in what they have lost: beyond, one is weak or has moved."""
STEEP = 0.1
"""Slope of a dent that stays: its product with a touch's slope is not in the flat frame."""
NOTICEABLE = 0.02
"""Slope from which it is a dent: smooth departures of another film are less steep."""


class Recalibration(NamedTuple):
    """The figures, and a sentence."""

    quality: Metrics
    advice: str


@node
def advise_recalibration(
    strength: Annotated[F4, Port("K", "1")],
    dent: Height,
    pixel: PixelSize,
    refitted: Metrics,
    before: Metrics,
) -> Recalibration:
    """Return what has changed as figures, and what to do as a sentence.

    Parameters
    ----------
    strength, dent
        Light of each LED, K, and the film's height, H x W in mm, relative to the old film, as
        `film_change` gives them.
    pixel
        mm per px.
    refitted
        What the fit to the check press found; nothing if there was none.
    before
        The figures of the old calibration.

    Returns
    -------
    Recalibration
        All figures of `refitted`; ``light_percent/...`` of each LED; ``dent_um`` and
        ``dent_slope`` of the deepest dent, 0 if there is none; ``full_calibration_due``, 0 or 1.
    """
    height, slope = _dent(dent, pixel)
    full = next((before[name] for name in REFERENCES if name in before), None)
    kept = {name: before[name] for name in REFERENCES if name in before}
    reasons = _reasons(strength, slope, refitted, full)
    quality = (
        refitted
        | {f"light_percent/led{k}": 100 * float(s) for k, s in enumerate(strength, start=1)}
        | {"dent_um": 1e3 * height, "dent_slope": slope}
        | kept
        | {"full_calibration_due": float(bool(reasons))}
    )
    return Recalibration(quality, _sentence(reasons, refitted, full))


def _dent(dent: F4, pixel: float) -> tuple[float, float]:
    """Height in mm and slope of what stands out of the film, 0 if nothing does."""
    by_y, by_x = np.gradient(dent, pixel)
    slope = np.hypot(by_x, by_y)
    if slope.max() < NOTICEABLE:
        return 0.0, 0.0
    return float(dent.flat[np.abs(dent).argmax()]), float(slope.max())


def _reasons(strength: F4, slope: float, refitted: Metrics, full: float | None) -> list[str]:
    found = []
    error = refitted.get("check_deg/held_out")
    most = GOOD if full is None else max(WORSE * full, GOOD)
    if error is not None and error > most:
        found.append(f"normals of the check press are off by {error:.2f} degrees")
    if abs(refitted.get("thicker_mm", 0.0)) > THICKER:
        found.append(f"the gel is {refitted['thicker_mm']:+.2f} mm thicker")
    uneven = strength / np.median(strength)
    if np.abs(uneven - 1).max() > UNEVEN:
        k = int(np.abs(uneven - 1).argmax())
        found.append(f"LED {k + 1} has {100 * uneven[k]:.0f} % of the light that the others have")
    if slope > STEEP:
        found.append(f"the film kept a dent with slopes of {slope:.2f}: change the film")
    return found


def _sentence(reasons: list[str], refitted: Metrics, full: float | None) -> str:
    if reasons:
        return "a full calibration is due: " + "; ".join(reasons)
    if "check_deg/held_out" not in refitted:
        return (
            "the flat frame is new, the film is taken to be as before; press a ball and give "
            "capture= to find out"
        )
    then = "" if full is None else f" (the full calibration: {full:.2f})"
    error = refitted["check_deg/held_out"]
    return f"no full calibration is due: the check press is right to {error:.2f} degrees{then}"
