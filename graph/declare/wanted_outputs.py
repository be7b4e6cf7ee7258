"""The outputs of a node that are read: it need not make the others."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Wanted:
    """The names of the wanted outputs, for a node with a keyword-only argument of this type.

    ``"variance" in wanted`` says whether that output is read.  The NumPy function returns None for
    an output that it does not make; the kernel gets a null pointer.
    """

    names: frozenset[str] | None = None

    def __contains__(self, name: object) -> bool:
        return self.names is None or name in self.names


EVERYTHING = Wanted()
