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

    By default they are equal.  A `share` of them may differ, where a decision on a rounded value
    goes the other way; then one always may, for the sake of tiny arrays.
    """

    absolute: float = 0.0
    relative: float = 0.0
    share: float = 0.0
    why: str = "rounding"

    def difference(self, reference: NDArray[Any], other: NDArray[Any]) -> str | None:
        differs = _differs(reference, other, self.absolute, self.relative)
        most = max(1.0, self.share * differs.size) if self.share else 0.0
        return _first(differs, reference, other) if differs.sum() > most else None


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
