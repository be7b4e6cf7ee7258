"""Types of the keyword-only arguments that the engine supplies to a node."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Protocol, TypeVar

T = TypeVar("T")


class Session:
    """The memory of one node of a pipeline, for objects that cannot flow along an edge.

    A node asks for it by a keyword-only argument of this type, and gets the same object for every
    item.  Plain values should come back by a `previous` edge instead.
    """

    def __init__(self) -> None:
        self._values: list[Any] = []

    def keep(self, make: Callable[[], T]) -> T:
        """Return what the first call of `make` returned; it is closed with the pipeline."""
        if not self._values:
            self._values.append(make())
        value: T = self._values[0]
        return value

    def close(self) -> None:
        """Close the kept object, if it has a ``close()``, and forget it."""
        while self._values:
            close = getattr(self._values.pop(), "close", None)
            if close is not None:
                close()


@dataclass(frozen=True)
class Wanted:
    """The names of the outputs that are read, for a node with a keyword-only argument of this type.

    ``"variance" in wanted`` is true if that output is read.  The NumPy function may return None for
    an output that is not; the kernel gets a null pointer for it.
    """

    names: frozenset[str] | None = None

    def __contains__(self, name: object) -> bool:
        return self.names is None or name in self.names


EVERYTHING = Wanted()


class NodeCall(Protocol):
    """The type of a keyword-only argument by which a node calls another node, its default.

    ``bounce: NodeCall = film_bounce`` is called like that node, with arrays on the host.  The
    engine replaces it by a call on the device where the graph prefers one and the node has kernels.
    """

    def __call__(self, *inputs: Any, **settings: Any) -> Any: ...


KeepIntegers = Annotated[bool, "only a device reads the images"]
"""The type of a source's keyword-only argument that is true if only a device reads the images.

The source may then yield K x H x W unsigned integers; kernels read them as fractions of full scale.
"""
