"""The normal of a slope: its harmonics, its derivatives, and one Gauss-Newton step by them."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes.optics.normals import dot

MIN_DETERMINANT = np.float32(1e-12)
Vector = tuple[F4, F4, F4]


@dataclass(frozen=True)
class SlopeNormal:
    """The unit normal n = (-p, -q, 1) / sqrt(1 + p^2 + q^2) of slopes, which points to the camera.

    All is computed when it is asked for, in the slopes' precision.
    """

    p: F4
    q: F4

    @cached_property
    def square(self) -> F4:
        """1 + p^2 + q^2."""
        return np.asarray(1 + self.p * self.p + self.q * self.q)

    @cached_property
    def normal(self) -> Vector:
        w: F4 = np.asarray(1 / np.sqrt(self.square))
        return -self.p * w, -self.q * w, w

    @cached_property
    def _derivatives(self) -> tuple[Vector, Vector]:
        p, q, w = self.p, self.q, self.normal[2]
        cube = w / self.square
        by_p = (p * p * cube - w, p * q * cube, -p * cube)
        return by_p, (p * q * cube, q * q * cube - w, -q * cube)

    @property
    def harmonics(self) -> F4:
        """The nine spherical harmonics up to second order, 9 x ..., without normalising factors.

        They are 1, n_x, n_y, n_z, n_x n_y, n_x n_z, n_y n_z, n_x^2 - n_y^2, 3 n_z^2 - 1.
        """
        x, y, z = self.normal
        mixed, squares = (x * y, x * z, y * z), (x * x - y * y, 3 * z * z - 1)
        return np.stack([np.ones_like(z), x, y, z, *mixed, *squares])

    def by_slope(self, gradient: Any) -> tuple[F4, F4]:
        """Return the derivatives by p and by q of what has this gradient by the normal."""
        by_p, by_q = self._derivatives
        return dot(gradient, by_p), dot(gradient, by_q)

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
