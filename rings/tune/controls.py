"""The control of a parameter, read from its declaration."""

import math
import typing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

MIN_LOG_DECADES = 2.5
"""The least width of a positive range with a logarithmic slider."""
Kind = Literal["slider", "choice", "flag", "text"]
Limits = tuple[float | None, float | None, float | None, float | None]
"""The value is at least, above, at most, below; None where there is no limit."""


@dataclass(frozen=True)
class Control:
    """A control: its kind, and the range of a slider."""

    kind: Kind
    low: float = 0.0
    high: float = 1.0
    whole: bool = False
    log: bool = False
    choices: tuple[Any, ...] = ()

    def place(self, value: float) -> float:
        """The place of a value on the slider, 0 to 1000."""
        if self.log:
            value = max(value, self.low)
            part = math.log(value / self.low) / math.log(self.high / self.low)
        else:
            part = (value - self.low) / (self.high - self.low)
        return 1000 * min(max(part, 0.0), 1.0)

    def value(self, place: float) -> float | int:
        """The value at a place of the slider, to three digits."""
        part = place / 1000
        if self.log:
            number = self.low * math.exp(part * math.log(self.high / self.low))
        else:
            number = self.low + part * (self.high - self.low)
        if self.whole:
            return round(number)
        if place in (0, 1000):
            return self.high if place else self.low
        span = self.high if self.log else self.high - self.low
        step = number if self.log else span
        digits = 2 - math.floor(math.log10(abs(step))) if step else 3
        return round(number, digits)


def control_of(annotation: Any, limits: Limits, default: Any, value: Any) -> Control:
    """The control for a parameter of such a declaration whose value is now `value`."""
    if typing.get_origin(annotation) is Literal:
        return Control("choice", choices=typing.get_args(annotation))
    if annotation is bool:
        return Control("flag")
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if annotation not in (int, float) or not is_number or isinstance(value, Path):
        return Control("text")
    usual = float(default) if isinstance(default, int | float) else float(value)
    low, high = _range(limits, usual, float(value))
    log = low > 0 and high / low >= 10**MIN_LOG_DECADES
    if low >= high:
        return Control("text")
    return Control("slider", low, high, annotation is int, log)


def _range(limits: Limits, usual: float, value: float) -> tuple[float, float]:
    """The declared range; where it is open, one around the default that holds the value."""
    low, above, high, below = limits
    size = max(abs(usual), abs(value)) or 1.0
    if high is None:
        high = 4 * size if below is None else below - 1e-3 * abs(below or 1.0)
    if low is None and above is not None:
        low = above + 1e-3 * (high - above)
    elif low is None:
        low = -4 * size if usual < 0 or value < 0 else 0.0
    return min(low, value), max(high, value)
