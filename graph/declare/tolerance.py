"""Tolerances: the difference allowed between two back ends, with the reason."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


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
        """Return None if `other` is close enough to `reference`, else the difference in words."""
        differs = np.asarray(reference != other)
        if reference.dtype.kind == "f":
            limits = {"rtol": self.relative, "atol": self.absolute}
            differs = ~np.isclose(other, reference, equal_nan=True, **limits)
        if differs.sum() <= (max(1.0, self.share * differs.size) if self.share else 0.0):
            return None
        where = tuple(int(i) for i in np.argwhere(differs)[0])
        return (
            f"{int(differs.sum())} of {differs.size} elements differ, "
            f"first at {where}: {reference[where]!r} against {other[where]!r}"
        )
