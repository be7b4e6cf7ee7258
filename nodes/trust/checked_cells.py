"""Which cells of a touch the checks use."""

from typing import Any

import cv2
import numpy as np

from tactograph.nodes import F4

NOT_TESTED = np.float32(-1)
"""Value of a map where it holds no test."""
MIN_LIGHT = np.float32(1e-3)
"""Lower bound on light in a denominator or a logarithm."""
DARK_LIGHT = np.float32(0.05)
"""Light that counts as black, relative to the film at rest in the same touch."""
MIN_CELLS = 20
"""Minimum cells for a verdict."""
MIN_LEDS = 3
"""Two LEDs fit any light, so their slope is untested."""
MAX_CELLS = 2500
"""Enough cells for a median; of larger images every n-th row and column is used."""


def quarter_of(values: F4, quarter: int) -> float:
    """Return the lower quartile, median or upper quartile (1, 2, 3); 0 for too few values."""
    if values.size < MIN_CELLS:
        return 0.0
    place = quarter * values.size // 4
    return float(np.partition(values, place)[place])


def thinning(rows: int, columns: int) -> int:
    """Return the n of every n-th row and column of images with more than `MAX_CELLS` pixels."""
    return max(1, round(float(np.sqrt(rows * columns / MAX_CELLS))))


def thinned(planes: Any) -> Any:
    """Every n-th row and column."""
    step = thinning(*planes.shape[-2:])
    return planes[..., ::step, ::step]


def few_cells(planes: F4, most: int = MAX_CELLS) -> F4:
    """Average planes K x H x W over cells, so that at most about `most` cells remain."""
    rows, columns = planes.shape[1:]
    finer = max(1.0, float(np.sqrt(rows * columns / most)))
    size = max(2, round(columns / finer)), max(2, round(rows / finer))
    return np.asarray([cv2.resize(plane, size, interpolation=cv2.INTER_AREA) for plane in planes])
