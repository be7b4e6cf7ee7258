"""What a page offers for a parameter, read from its declaration."""

from __future__ import annotations

import math
import types
import typing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import annotated_types

from tactograph.graph.declare.node import Parameter

DECADES = 2.5
"""A range of positive numbers that is wider gets a logarithmic slider."""
Kind = Literal["slider", "choice", "flag", "text"]


@dataclass(frozen=True)
class Control:
    """A control: its kind, and for a slider where it goes from and to."""

    kind: Kind
    low: float = 0.0
    high: float = 1.0
    whole: bool = False
    log: bool = False
    choices: tuple[Any, ...] = ()

    def place(self, value: float) -> float:
        """Where a value lies on the slider, 0 to 1000."""
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
            found = self.low * math.exp(part * math.log(self.high / self.low))
        else:
            found = self.low + part * (self.high - self.low)
        if self.whole:
            return round(found)
        if place in (0, 1000):
            return self.high if place else self.low
        span = self.high if self.log else self.high - self.low
        step = found if self.log else span
        digits = 2 - math.floor(math.log10(abs(step))) if step else 3
        return round(found, digits)


def control_of(parameter: Parameter, value: Any) -> Control:
    """The control for a parameter whose value is now `value`."""
    annotation, rules = _unwrapped(parameter.annotation)
    if typing.get_origin(annotation) is Literal:
        return Control("choice", choices=typing.get_args(annotation))
    if annotation is bool:
        return Control("flag")
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if annotation not in (int, float) or not is_number or isinstance(value, Path):
        return Control("text")
    default = value if parameter.required else parameter.default
    low, high = _range(rules, float(value), default)
    log = low > 0 and high / low >= 10**DECADES
    if low >= high:
        return Control("text")
    return Control("slider", low, high, annotation is int, log)


def _unwrapped(annotation: Any) -> tuple[Any, list[Any]]:
    """The type itself, and what bounds it."""
    rules: list[Any] = []
    while typing.get_origin(annotation) is typing.Annotated:
        annotation, *more = typing.get_args(annotation)
        for mark in more:
            rules += mark if isinstance(mark, annotated_types.GroupedMetadata) else (mark,)
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        members = [each for each in typing.get_args(annotation) if each is not type(None)]
        if len(members) == 1:
            inner, more = _unwrapped(members[0])
            return inner, [*rules, *more]
    return annotation, rules


def _range(rules: list[Any], value: float, default: Any) -> tuple[float, float]:
    """The declared range; where it is open, one around the default that holds the value."""
    low = _limit(rules, annotated_types.Ge, "ge")
    above = _limit(rules, annotated_types.Gt, "gt")
    high = _limit(rules, annotated_types.Le, "le")
    below = _limit(rules, annotated_types.Lt, "lt")
    usual = float(default) if isinstance(default, int | float) else value
    size = max(abs(usual), abs(value)) or 1.0
    if high is None:
        high = 4 * size if below is None else below - 1e-3 * abs(below or 1.0)
    if low is None:
        if above is not None:
            low = above + 1e-3 * (high - above)
        else:
            low = -4 * size if usual < 0 or value < 0 else 0.0
    return min(low, value), max(high, value)


def _limit(rules: list[Any], kind: type, name: str) -> float | None:
    found = next((getattr(rule, name) for rule in rules if isinstance(rule, kind)), None)
    return None if found is None else float(found)
