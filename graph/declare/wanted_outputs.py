"""The outputs of a node that something reads: a node need not make the others."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Wanted:
    """What is asked of a node that has a keyword-only argument of this type.

    ``"variance" in wanted`` says whether the output of that name is read.  The NumPy function
    returns None for one that it does not make; the kernel finds a null pointer.
    """

    names: frozenset[str] | None = None

    def __contains__(self, name: object) -> bool:
        return self.names is None or name in self.names


EVERYTHING = Wanted()
