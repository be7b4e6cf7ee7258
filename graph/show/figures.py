"""Figures for people: means with their confidence intervals, and names in words."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean, stdev
from typing import Any

from scipy.special import stdtrit

CONFIDENCE_LEVEL = 0.95


@dataclass(frozen=True)
class Estimate:
    """A mean over runs, and the interval that holds it with 95 % confidence."""

    mean: float
    low: float
    high: float
    count: int

    @property
    def half(self) -> float:
        return (self.high - self.low) / 2

    def __str__(self) -> str:
        if self.count < 2:
            return f"{self.mean:.4g}"
        return f"{self.mean:.4g} ± {self.half:.2g}"


def estimate(values: Sequence[float]) -> Estimate:
    """The mean, with Student's interval where there are several values."""
    mean = fmean(values)
    if len(values) < 2:
        return Estimate(mean, mean, mean, len(values))
    quantile = float(stdtrit(len(values) - 1, 0.5 + CONFIDENCE_LEVEL / 2))
    half = quantile * stdev(values) / math.sqrt(len(values))
    return Estimate(mean, mean - half, mean + half, len(values))


def words(name: str) -> str:
    """A figure's name for people."""
    return name.replace("_", " ").replace("/", ", ")


def short(value: Any) -> str:
    """A value in few digits."""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
