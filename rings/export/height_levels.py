"""Heights as levels of 16 bits."""

import numpy as np
from numpy.typing import NDArray

from tactograph.sdk import Height, InputError

STEP_MM = 1e-4
"""A level: 0.1 micrometres."""
OFFSET_MM = -1.0
"""The height that level 0 would be; level 65535 is 5.5535 mm."""
UNKNOWN_LEVEL = 0
"""The level of unknown film."""
MAX_LEVEL = 65535

Levels = NDArray[np.uint16]


def height_levels(height: Height) -> Levels:
    """Return the nearest level of every height, H x W; `UNKNOWN_LEVEL` for NaN.

    Raises
    ------
    InputError
        If a height does not fit into 16 bits.
    """
    finite = np.isfinite(height)
    levels = np.rint((height[finite].astype(np.float64) - OFFSET_MM) / STEP_MM)
    if levels.size and (levels.min() <= UNKNOWN_LEVEL or levels.max() > MAX_LEVEL):
        raise InputError(
            f"heights from {height[finite].min():.2f} to {height[finite].max():.2f} mm do not fit "
            f"into {OFFSET_MM + STEP_MM:.4f} to {OFFSET_MM + MAX_LEVEL * STEP_MM:.4f} mm"
        )
    grey = np.full(height.shape, UNKNOWN_LEVEL, np.uint16)
    grey[finite] = levels
    return grey


def level_height(levels: NDArray[np.generic], step: float, offset: float) -> Height:
    """Return the heights of levels in mm."""
    with np.errstate(over="ignore"):  # too large for float32: infinite
        return np.asarray(offset + step * levels.astype(np.float64), np.float32)
