"""The outcome of one check of a touch."""

from typing import Any, NamedTuple

import numpy as np

from tactograph.nodes import F4

NOT_TESTED = np.float32(-1)
"""Value of a map where it tests nothing."""
DARK_AS_DUE = np.float32(-0.5)
"""Value where too few LEDs test a slope, and others are in the shadow in which it puts them."""
MIN_CELLS = 20
"""Fewer cells tell nothing of a touch."""
MIN_LEDS = 3
"""Two LEDs fit any light, so that their slope may be any."""
MAX_CELLS = 2500
"""More cells tell no more of medians; of larger images every n-th is looked at."""


class Check(NamedTuple):
    """Evidence against a touch, and its possible cause.  The larger check is the worse one."""

    figure: float
    """0: nothing; 1: the limit that right touches stay below."""
    cause: str = ""
    """Observation and remedy, for a message; facts stand for {}."""
    facts: tuple[object, ...] = ()

    def __str__(self) -> str:
        return self.cause.format(*self.facts)


def worst(figures: dict[str, float], *facts: object) -> Check:
    """Return the largest of these figures by cause; facts stand for {0}, {1}, ... in each."""
    cause = max(figures, key=figures.__getitem__)
    return Check(figures[cause], cause, facts)


def quarter_of(values: F4, quarter: int, least: int = MIN_CELLS) -> float:
    """Return the value that a quarter, two or three of them lie below; 0 of less than `least`."""
    if values.size < least:
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
