"""Report what a new film changes, the remaining error, and whether to calibrate fully."""

from typing import NamedTuple

import numpy as np

from tactograph.rings.recheck.nodes.film_change import FilmChange
from tactograph.sdk import F4, PixelSize, node, warn

REFERENCE_FIGURES = "film_heldout_deg", "heldout_normal_deg"
"""Figures that hold a full calibration's error on held-out presses, in degrees."""
DUE_ERROR_RATIO = 1.5
"""Error, relative to the full calibration's, above which another full calibration is due, ..."""
DUE_ERROR_DEG = 0.5
"""... if it also exceeds this many degrees."""
WRONG_ERROR_DEG = 3.0
"""Degrees above which the check press itself is doubted, if `DUE_ERROR_RATIO` holds, too."""
MAX_GAIN_CHANGE = 0.3
"""Change of the light's dependence on slope above which no gel explains it: three of the deviations
that `refit_reflectance_map` allows for a gel."""
RADIUS_ADVICE = "or ball_radius_mm is wrong: is it the radius, not its diameter?"
MAX_THICKER_MM = 1.0
"""Change of the gel's thickness in mm above which LED light takes another path to the film."""
MAX_LED_DIFFERENCE = 0.2
"""Relative difference between the LEDs' changes above which one is weak or has moved."""
MAX_DENT_SLOPE = 0.1
"""Largest slope of a dent that the flat frame can correct.  Above it, the product of the dent's
slope and a touch's matters, which the flat frame does not hold."""
MIN_DENT_SLOPE = 0.02
"""Slope from which a departure is a dent; smooth differences between films are less steep."""


class RecalibrationAdvice(NamedTuple):
    """What has changed, in figures, what to do, in one sentence, and doubts of the new file."""

    quality: dict[str, float]
    advice: str
    doubts: list[str]


@node
def advise_recalibration(
    change: FilmChange,
    pixel: PixelSize,
    refitted: dict[str, float],
    before: dict[str, float],
    doubts: list[str] | None = None,
) -> RecalibrationAdvice:
    """Report what has changed in figures, and what to do in one sentence.

    Parameters
    ----------
    change : as `film_change` returns it, relative to the old film
    pixel : mm per px
    refitted : figures of the fit to the check press; empty if there was none
    before, doubts : the figures of the old calibration, and what speaks against it

    Returns
    -------
    All figures of `refitted`; ``light_percent/...`` of each LED; ``dent_um`` and ``dent_slope``,
    the largest height and slope of a dent, 0 if there is none; ``full_calibration_due``, 0 or 1.  A
    warning says if the check press cannot be right.  What makes heights wrong, if the new film is
    not as the check press says, is a doubt of the new calibration, too.
    """
    strength = change.strength
    height, slope = _dent(change.dent, pixel)
    reference = {name: before[name] for name in REFERENCE_FIGURES if name in before}
    full = next(iter(reference.values()), None)
    contradictions = _contradictions(refitted, full)
    reasons = contradictions + _reasons(strength, slope)
    quality = (
        refitted
        | change.light_percent()
        | {"dent_um": 1e3 * height, "dent_slope": slope}
        | reference
        | {"full_calibration_due": float(bool(reasons))}
    )
    return RecalibrationAdvice(
        quality, _sentence(reasons, refitted, full), [*(doubts or []), *contradictions]
    )


def _dent(dent: F4, pixel: float) -> tuple[float, float]:
    """Largest height in mm and slope of a dent, 0 if there is none."""
    by_y, by_x = np.gradient(dent, pixel)
    slope = np.hypot(by_x, by_y)
    if slope.max() < MIN_DENT_SLOPE:
        return 0.0, 0.0
    return float(dent.flat[np.abs(dent).argmax()]), float(slope.max())


def _contradictions(refitted: dict[str, float], full: float | None) -> list[str]:
    """Return what the check press says of the new film that a mistake may say instead."""
    reasons = []
    error = refitted.get("check_deg/held_out")
    most = DUE_ERROR_DEG if full is None else max(DUE_ERROR_RATIO * full, DUE_ERROR_DEG)
    if error is not None and error > most:
        off = f"normals of the check press are off by {error:.2f} degrees"
        reasons.append(off)
        if error > WRONG_ERROR_DEG:
            warn(
                f"{off}, so the new calibration is wrong: check the order of the press's images, "
                "the ball's radius, and that film and ball are clean, and recalibrate"
            )
    if abs(refitted.get("thicker_mm", 0.0)) > MAX_THICKER_MM:
        thicker = refitted["thicker_mm"]
        reasons.append(f"the new gel is {thicker:+.2f} mm thicker, {RADIUS_ADVICE}")
    gains = [gain / 100 for name, gain in refitted.items() if name.startswith("gain_percent/")]
    if gains and abs(np.median(gains) - 1) > MAX_GAIN_CHANGE:
        reasons.append(
            f"on the new gel light depends {np.median(gains):.2g} times as much on slope as on the "
            f"old, {RADIUS_ADVICE}"
        )
    return reasons


def _reasons(strength: F4, slope: float) -> list[str]:
    reasons = []
    uneven = strength / np.median(strength)
    if np.abs(uneven - 1).max() > MAX_LED_DIFFERENCE:
        k = int(np.abs(uneven - 1).argmax())
        reasons.append(f"LED {k + 1} has {100 * uneven[k]:.0f} % of the light that the others have")
    if slope > MAX_DENT_SLOPE:
        reasons.append(f"the film kept a dent with slopes of {slope:.2f}: change the film")
    return reasons


def _sentence(reasons: list[str], refitted: dict[str, float], full: float | None) -> str:
    if reasons:
        return "a full calibration is due: " + "; ".join(reasons)
    if "check_deg/held_out" not in refitted:
        return (
            "the flat frame is new, the film is taken to be as before; give presses of a ball as "
            "well to find out"
        )
    then = "" if full is None else f" (the full calibration: {full:.2f})"
    error = refitted["check_deg/held_out"]
    return f"no full calibration is due: the check press is right to {error:.2f} degrees{then}"
