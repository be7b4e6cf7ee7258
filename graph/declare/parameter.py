"""A parameter of a node: its type, its limits and its default."""

import inspect
import typing
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import annotated_types

from tactograph.graph.declare.annotations import bare_type, parts_of

_LIMIT_TYPES = (annotated_types.Ge, annotated_types.Gt, annotated_types.Le, annotated_types.Lt)


class Limits(NamedTuple):
    """The limits of a number, None where there is none."""

    at_least: float | None
    above: float | None
    at_most: float | None
    below: float | None


@dataclass(frozen=True)
class Parameter:
    """A keyword-only argument: a setting in the graph file."""

    name: str
    annotation: Any
    default: Any = inspect.Parameter.empty

    @property
    def required(self) -> bool:
        return self.default is inspect.Parameter.empty

    @property
    def type(self) -> Any:
        """The type without `Annotated`; for ``X | None`` it is X."""
        return bare_type(self.annotation)

    @property
    def limits(self) -> Limits:
        """The limits that the annotation states."""
        stated: dict[type, float] = {}
        for part in parts_of(self.annotation):
            for mark in getattr(part, "__metadata__", ()):
                for rule in mark if isinstance(mark, annotated_types.GroupedMetadata) else (mark,):
                    if isinstance(rule, _LIMIT_TYPES):
                        stated[type(rule)] = float(getattr(rule, type(rule).__name__.lower()))
        return Limits(*map(stated.get, _LIMIT_TYPES))

    @property
    def choices(self) -> list[Any]:
        """The values that the annotation's `Literal` lists."""
        literals = [p for p in parts_of(self.annotation) if typing.get_origin(p) is Literal]
        return [choice for literal in literals for choice in typing.get_args(literal)]

    @property
    def range(self) -> str:
        """The allowed values in words: ``0 to 1``, ``above 0``, ``one of a, b``."""
        if self.choices:
            return f"one of {', '.join(map(str, self.choices))}"
        limits = self.limits
        if limits.at_least is not None and limits.at_most is not None:
            return f"{limits.at_least:g} to {limits.at_most:g}"
        words = zip(("at least", "above", "at most", "below"), limits, strict=True)
        return " and ".join(f"{word} {limit:g}" for word, limit in words if limit is not None)
