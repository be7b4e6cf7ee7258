"""A touched surface on cells of pixels, rigid motions, and one surface in the place of another."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tactograph.sdk import F4, F8

IN_DEGREES = np.array([1, 1, 1, *[np.degrees(1.0)] * 3])
"""Six numbers in mm and rad to mm and degrees."""


class Surface(NamedTuple):
    """Heights of cells in mm, NaN where not all of a cell is touched."""

    height: F4
    variance: float | None
    """Of a slope; None where not stated."""
    side: float
    left: float
    top: float
    """Vector in mm from the image's middle to that of the first cell."""

    @property
    def touched(self) -> NDArray[np.bool_]:
        """Mask of the cells."""
        return np.isfinite(self.height)

    def coarser(self, factor: int) -> Surface:
        """The surface on cells of `factor` x `factor` of these."""
        rows, columns = (size // factor for size in self.height.shape)
        inside = self.height[: rows * factor, : columns * factor]
        height = cv2.resize(inside, (columns, rows), interpolation=cv2.INTER_AREA)
        doubt = None if self.variance is None else self.variance / factor**2
        more = (factor - 1) / 2 * self.side
        left, top = self.left + more, self.top + more
        return Surface(np.asarray(height), doubt, factor * self.side, left, top)

    def cropped(self) -> Surface:
        """The rows and columns that are touched."""
        down, right = (np.flatnonzero(self.touched.any(axis=axis)) for axis in (1, 0))
        if not len(down):
            return self
        left, top = self.left + right[0] * self.side, self.top + down[0] * self.side
        height = self.height[down[0] : down[-1] + 1, right[0] : right[-1] + 1]
        return Surface(np.ascontiguousarray(height), self.variance, self.side, left, top)

    def points(self) -> F8:
        """The touched cells' points in mm, 3 x N."""
        planes = np.broadcast_arrays(*self.places(), self.height)
        return np.stack([plane[self.touched] for plane in planes]).astype(np.float64)

    def places(self) -> tuple[F4, F4]:
        """x and y in mm from the image's middle: a row, and a column."""
        x, y = (np.arange(n, dtype=np.float32) for n in self.height.shape[::-1])
        return x * np.float32(self.side) + np.float32(self.left), (
            y * np.float32(self.side) + np.float32(self.top)
        )[:, None]


def surface_of(height: F4, variance: float | None, pixel: float) -> Surface:
    """The touched surface, NaN elsewhere, on pixels of `pixel` mm."""
    left, top = ((1 - size) / 2 * pixel for size in height.shape[::-1])
    return Surface(height, variance, pixel, left, top)


def small_motion(step: F8) -> F8:
    """The 4 x 4 matrix of a shift in mm and a turn in rad."""
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(step[3:]).as_matrix()
    motion[:3, 3] = step[:3]
    return motion


def six_numbers(motion: F8) -> F8:
    """Shift in mm and turn in rad of a 4 x 4 matrix."""
    return np.concatenate([motion[:3, 3], Rotation.from_matrix(motion[:3, :3]).as_rotvec()])


def carried(motion: F8) -> F8:
    """The adjoint, 6 x 6, which turns a small motion before `motion` into one after it."""
    turn = motion[:3, :3]
    return np.block([[turn, cross_matrix(motion[:3, 3]) @ turn], [np.zeros((3, 3)), turn]])


def cross_matrix(place: F8) -> F8:
    """The 3 x 3 matrix that takes v to place x v; a small turn w moves a place by w x place."""
    x, y, z = place
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def normals(height: F4, side: float) -> F4:
    """-dz/dx and -dz/dy, 2 x H x W, by central differences."""
    down, right = np.gradient(height, np.float32(side))
    return np.stack([-right, -down])


def cells_at(surface: Surface, motion: F8, x: F4, y: F4, z: F4) -> tuple[F4, F4, F4]:
    """Column and row of `surface` at which points lie that `motion` moves, and their height."""
    r = motion.astype(np.float32)
    across, down, up = (r[i, 0] * x + r[i, 1] * y + r[i, 2] * z + r[i, 3] for i in range(3))
    side = np.float32(surface.side)
    return (across - np.float32(surface.left)) / side, (down - np.float32(surface.top)) / side, up


def pulled_back(surface: Surface, motion: F8, x: F4, y: F4, z: F4, steepness: F4) -> F4:
    """Height of `surface`, moved back by `motion`, above the points; NaN where it is not touched.

    `steepness` is -dz/dx and -dz/dy of the points' surface.
    """
    column, row, up = cells_at(surface, motion, x, y, z)
    heights = cv2.remap(
        surface.height, column, row, cv2.INTER_LINEAR, borderValue=(float("nan"),) * 4
    )
    r = motion.astype(np.float32)
    leaning = r[2, 0] * steepness[0] + r[2, 1] * steepness[1] + r[2, 2]
    return np.asarray((heights - up) * leaning)
