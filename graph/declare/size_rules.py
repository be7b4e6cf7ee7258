"""What a declaration states about sizes: their limits, and sizes that follow from others."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class SizeLimit:
    """The range of sizes that a node accepts for one symbol, and the reason."""

    low: int
    high: int | None
    why: str

    def refuses(self, size: int) -> bool:
        return size < self.low or (self.high is not None and size > self.high)


@dataclass(frozen=True)
class SizeRule:
    """A size computed from other sizes ("H", or "H W") and one parameter.

    `rule` computes it, and raises InputError if the sizes are not compatible.  Without a rule it
    is the other size divided by the parameter, rounded up.
    """

    of: str
    by: str
    rule: Callable[..., int] | None = None

    def size(self, sizes: Mapping[str, int], settings: Mapping[str, Any]) -> int:
        if self.rule is None:
            return -(-sizes[self.of] // int(settings[self.by]))
        return self.rule(*(sizes[symbol] for symbol in self.of.split()), settings[self.by])

    def __str__(self) -> str:
        return f"{self.of}{', ' if self.rule else ' / '}{self.by}"
