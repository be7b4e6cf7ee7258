"""Cross-sections that several shapes have."""

from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.sdk import F8

WallAngle = Annotated[float, Interval(gt=0, le=90)]
"""Angle of a wall against the plane, in degrees; 90 is vertical."""


def risen(within: F8, rise_mm: float, wall_deg: float) -> F8:
    """Return the height of a wall, by the distance from its middle: half of `rise_mm` at 0."""
    run = rise_mm / np.tan(np.radians(wall_deg))
    return np.asarray(rise_mm * np.clip(within / max(run, 1e-9) + 0.5, 0, 1))


def stretched(height: F8, rise_mm: float | None) -> F8:
    """Return heights scaled so that the highest is `rise_mm`; None keeps them."""
    top = float(height.max(initial=0.0))
    return height if rise_mm is None or top <= 0 else height * (rise_mm / top)
