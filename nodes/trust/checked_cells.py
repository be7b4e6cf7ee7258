"""The cells that the checks of a touch look at, and from when on they count."""

from typing import Any

import cv2
import numpy as np

from tactograph.nodes import F4

NOT_TESTED = np.float32(-1)
"""Value of a map where it tests nothing."""
MIN_LIGHT = np.float32(1e-3)
"""Light that is divided by, or of which the logarithm is taken, at least."""
DARK_LIGHT = np.float32(0.05)
"""Light that counts as none, relative to that of the film at rest in the touch."""
MIN_CELLS = 20
"""Minimum cells for a verdict."""
MIN_LEDS = 3
"""Two LEDs fit any light, so that their slope may be any."""
MAX_CELLS = 2500
"""More cells tell no more of medians; of larger images every n-th is looked at."""


def quarter_of(values: F4, quarter: int) -> float:
    """Return the value that a quarter, two or three of them lie below; 0 of too few."""
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
    """Return planes K x H x W on cells of which an image has `most`, if it has more pixels."""
    rows, columns = planes.shape[1:]
    finer = max(1.0, float(np.sqrt(rows * columns / most)))
    size = max(2, round(columns / finer)), max(2, round(rows / finer))
    return np.asarray([cv2.resize(plane, size, interpolation=cv2.INTER_AREA) for plane in planes])
