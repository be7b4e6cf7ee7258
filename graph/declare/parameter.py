"""A parameter of a node: its type, its limits and its default."""

import inspect
from dataclasses import dataclass
from typing import Any

from tactograph.graph.declare.limits import Limits, bare_type, choices_of, limits_of


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
        return limits_of(self.annotation)

    @property
    def choices(self) -> list[Any]:
        """The values that the annotation's `Literal` lists."""
        return choices_of(self.annotation)

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
