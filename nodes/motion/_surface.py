"""A touched surface on cells of pixels, rigid motions, and one surface in the place of another."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tactograph.nodes import F4

F8 = NDArray[np.float64]
CELL_SIDES_PX = 8, 4, 2, 1
"""Pixels of a side in a cell, coarse to fine."""
IN_DEGREES = np.array([1, 1, 1, *[np.degrees(1.0)] * 3])
"""Six numbers in mm and rad to mm and degrees."""


class Surface(NamedTuple):
    """Heights of cells in mm, those that are touched, and the variance of a touched slope."""

    height: F4
    touched: NDArray[np.bool_]
    variance: float | None
    side: float
    left: float
    top: float
    """Vector in mm from the image's middle to that of the first cell."""


def pyramid(
    height: F4, touched: NDArray[np.bool_], variance: float | None, pixel: float, finest: int
) -> list[Surface]:
    """The surface on cells of `CELL_SIDES_PX` down to `finest` px, without its untouched film."""
    return [
        _cells(height, touched, variance, pixel, factor)
        for factor in CELL_SIDES_PX
        if factor >= finest
    ]


def _cells(
    height: F4, touched: NDArray[np.bool_], variance: float | None, pixel: float, factor: int
) -> Surface:
    """The surface on cells of `factor` px, where it is touched."""
    rows, columns = (size // factor for size in height.shape)

    def means(plane: F4) -> F4:
        inside = plane[: rows * factor, : columns * factor]
        return np.asarray(cv2.resize(inside, (columns, rows), interpolation=cv2.INTER_AREA))

    whole = means(touched.astype(np.float32)) > 0.99
    doubt = None if variance is None else variance / factor**2
    left, top = ((factor - size) / 2 * pixel for size in height.shape[::-1])
    return Surface(means(height), whole, doubt, factor * pixel, left, top)


def trimmed(surface: Surface) -> Surface:
    """Rows and columns that are touched, without the rim, which has no central differences."""
    inner = cv2.erode(surface.touched.view(np.uint8), np.ones((3, 3), np.uint8), borderValue=0) > 0
    down, right = np.nonzero(surface.touched)
    if not len(down):
        return surface
    y, x = max(down.min() - 1, 0), max(right.min() - 1, 0)
    part = slice(y, down.max() + 2), slice(x, right.max() + 2)
    left, top = surface.left + x * surface.side, surface.top + y * surface.side
    height = np.ascontiguousarray(surface.height[part])
    touched = np.ascontiguousarray(inner[part])
    return Surface(height, touched, surface.variance, surface.side, left, top)


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
    turn, (x, y, z) = motion[:3, :3], motion[:3, 3]
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.block([[turn, cross @ turn], [np.zeros((3, 3)), turn]])


def places(surface: Surface) -> tuple[F4, F4]:
    """x and y in mm from the image's middle, of all cells."""
    rows, columns = surface.height.shape
    x = np.float32(surface.left) + np.arange(columns, dtype=np.float32) * np.float32(surface.side)
    y = np.float32(surface.top) + np.arange(rows, dtype=np.float32) * np.float32(surface.side)
    return np.broadcast_to(x, (rows, columns)), np.broadcast_to(y[:, None], (rows, columns))


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


def pulled_back(
    surface: Surface, motion: F8, x: F4, y: F4, z: F4, steepness: F4
) -> tuple[F4, NDArray[np.bool_]]:
    """Height of `surface`, moved back by `motion`, above the points, and the mask where it is
    touched.

    Parameters
    ----------
    steepness
        -dz/dx and -dz/dy of the points' surface.
    """
    column, row, up = cells_at(surface, motion, x, y, z)
    heights = cv2.remap(surface.height, column, row, cv2.INTER_LINEAR)
    touched = cv2.remap(surface.touched.astype(np.float32), column, row, cv2.INTER_LINEAR) > 0.99
    r = motion.astype(np.float32)
    leaning = r[2, 0] * steepness[0] + r[2, 1] * steepness[1] + r[2, 2]
    return (heights - up) * leaning, touched
