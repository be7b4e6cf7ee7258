"""One Gauss-Newton step for a slope: the normal's derivatives, and a step of limited length."""

from typing import Any, NamedTuple, Self

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes.optics.normals import dot

MIN_DETERMINANT = np.float32(1e-12)
Vector = tuple[F4, F4, F4]


class SlopeNormal(NamedTuple):
    """1 + p^2 + q^2, the unit normal of a slope, and its derivatives by p and by q."""

    square: F4
    normal: Vector
    by_p: Vector
    by_q: Vector

    @classmethod
    def of(cls, p: F4, q: F4) -> Self:
        square: F4 = np.add(1 + p * p, q * q, dtype=np.float32)
        w: F4 = np.divide(1, np.sqrt(square), dtype=np.float32)
        cube: F4 = np.divide(w, square, dtype=np.float32)
        by_p = (p * p * cube - w, p * q * cube, -p * cube)
        by_q = (p * q * cube, q * q * cube - w, -q * cube)
        return cls(square, (-p * w, -q * w, w), by_p, by_q)

    def by_slope(self, gradient: Any) -> tuple[F4, F4]:
        """Return the derivatives by p and by q of what has this gradient by the normal."""
        return dot(gradient, self.by_p), dot(gradient, self.by_q)

    def step(self, matrix: Vector, right: tuple[F4, F4], limit: np.float32) -> tuple[F4, F4]:
        """Solve a dp + b dq = u, b dp + c dq = v, and shorten (dp, dq) to a turn of `limit`."""
        (a, b, c), (u, v) = matrix, right
        determinant = np.maximum(a * c - b * b, MIN_DETERMINANT)
        dp = np.divide(c * u - b * v, determinant, dtype=np.float32)
        dq = np.divide(a * v - b * u, determinant, dtype=np.float32)
        length: F4 = np.sqrt(dp * dp + dq * dq, dtype=np.float32)
        longest = limit * self.square
        shrink = np.minimum(1, longest / np.maximum(length, MIN_DETERMINANT), dtype=np.float32)
        return np.asarray(dp * shrink, np.float32), np.asarray(dq * shrink, np.float32)
