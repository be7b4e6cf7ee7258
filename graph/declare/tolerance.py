"""Tolerances: the difference allowed between two back ends, with the reason."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


class Tolerance(Protocol):
    """Compares the same output computed by two back ends."""

    @property
    def why(self) -> str: ...

    def difference(self, reference: NDArray[Any], other: NDArray[Any]) -> str | None:
        """Return None if `other` is close enough to `reference`, else the difference in words."""


@dataclass(frozen=True)
class Close:
    """All elements are within ``absolute + relative * |reference|``, NaN equal to NaN.

    By default they are equal.
    """

    absolute: float = 0.0
    relative: float = 0.0
    why: str = "rounding"

    def difference(self, reference: NDArray[Any], other: NDArray[Any]) -> str | None:
        differs = _differs(reference, other, self.absolute, self.relative)
        return _first(differs, reference, other) if differs.any() else None


@dataclass(frozen=True)
class Flips:
    """All elements are close but for a `share`, where a decision may go the other way.

    At least one flip is allowed, for the sake of tiny arrays.
    """

    share: float
    absolute: float = 0.0
    relative: float = 0.0
    why: str = "a decision on a rounded value"

    def difference(self, reference: NDArray[Any], other: NDArray[Any]) -> str | None:
        differs = _differs(reference, other, self.absolute, self.relative)
        if differs.sum() <= max(1.0, self.share * differs.size):
            return None
        return f"{differs.mean():.2%} flipped; " + _first(differs, reference, other)


def _differs(a: NDArray[Any], b: NDArray[Any], absolute: float, relative: float) -> NDArray[Any]:
    if a.dtype.kind != "f":
        return np.asarray(a != b)
    return np.asarray(~np.isclose(b, a, rtol=relative, atol=absolute, equal_nan=True))


def _first(differs: NDArray[Any], a: NDArray[Any], b: NDArray[Any]) -> str:
    where = tuple(int(i) for i in np.argwhere(differs)[0])
    return (
        f"{int(differs.sum())} of {differs.size} elements differ, "
        f"first at {where}: {a[where]!r} against {b[where]!r}"
    )
