"""Lens distortion and tilt of the camera: the map from a regular grid on the film to the image.

Places are measured from the image's middle in halves of its diagonal, so that r = 1 is a corner at
any resolution.  The ideal image has square pixels of equal size on the film at rest; L1 and L2 map
the ideal place (u, v) to the place (x, y) where the camera sees it:

- L1, tilt: q = ((1 + a) u + b v, b u + (1 - a) v) / (1 + gx u + gy v).  A homography has eight
  numbers; the other four are the film's position, rotation and scale, which the image's middle,
  its rows and the pixel size fix.
- L2, radial distortion (Brown, "Close-range camera calibration", 1971), about the centre
  c = (cx, cy): (x, y) = c + d (1 + k1 r^2 + k2 r^4), d = q - c, r = |d|.

The lens is the array (k1, k2, cx, cy, a, b, gx, gy).  With eight zeros (x, y) = (u, v).  Pixels
that are not square are a lens of `a` alone.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError
from tactograph.nodes import F4, I4, Lens

LENS_TERMS = ("k1", "k2", "cx", "cy", "a", "b", "gx", "gy")
NEWTON_STEPS = 4
"""Newton steps for the inverse of L2; at 20 % of distortion their errors are 2e-2, 2e-4, 2e-8."""
MAX_OBLONG = 1.3
"""Largest ratio of a pixel's sides; beyond, the ideal image would lack a large part of the film."""

Places = NDArray[Any]


def is_straight(lens: Lens) -> bool:
    """Return whether the lens changes nothing."""
    return not lens.any()


def oblong_lens(width: float, length: float) -> tuple[Lens, float]:
    """Return the lens of pixels that are not square, and the side of the ideal image's pixels.

    Parameters
    ----------
    width, length : sides of a pixel along x and y, in mm

    Raises
    ------
    InputError
        If one is longer than the other by more than `MAX_OBLONG`.
    """
    if max(width / length, length / width) > MAX_OBLONG:
        raise InputError(
            f"pixels of {width:g} x {length:g} mm: no camera's are so oblong; give their size "
            "as x,y in mm (if images were enlarged along one side, resize them)"
        )
    a = (length - width) / (length + width)
    return np.array([0, 0, 0, 0, a, 0, 0, 0], np.float32), (1 + a) * width


def half_diagonal(shape: tuple[int, ...]) -> np.float32:
    """Return half of the image's diagonal in px."""
    rows, columns = shape
    return np.float32(0.5) * np.sqrt(np.float32(columns * columns + rows * rows))


def camera_offset(lens: Sequence[Any] | Lens, u: Places, v: Places) -> tuple[Places, Places]:
    """Return (x - u, y - v), by L1 and L2; exactly zero without a lens."""
    k1, k2, cx, cy, a, b, gx, gy = lens
    w = gx * u + gy * v
    nearer = 1 / (w + 1)
    qu = (a * u + b * v - w * u) * nearer
    qv = (b * u - a * v - w * v) * nearer
    du, dv = u + qu - cx, v + qv - cy
    square = du * du + dv * dv
    bent = square * (k1 + k2 * square)
    return qu + bent * du, qv + bent * dv


def ideal_offset(lens: Sequence[Any] | Lens, x: Places, y: Places) -> tuple[Places, Places]:
    """Return (u - x, v - y), the inverse of L1 and L2; exactly zero without a lens."""
    k1, k2, cx, cy, a, b, gx, gy = lens
    dx, dy = x - cx, y - cy
    square = dx * dx + dy * dy
    one = k1 * square
    two = k2 * square * square
    f = np.ones_like(square)
    for _ in range(NEWTON_STEPS):
        ff = f * f
        f = f - (f * (one * ff + two * ff * ff + 1) - 1) / (3 * one * ff + 5 * two * ff * ff + 1)
    qx, qy = cx + f * dx, cy + f * dy
    m00, m01 = a - qx * gx + 1, b - qx * gy
    m10, m11 = b - qy * gx, 1 - a - qy * gy
    part = 1 / (m00 * m11 - m01 * m10)
    return (m11 * qx - m01 * qy) * part - x, (m00 * qy - m10 * qx) * part - y


def camera_places(lens: Lens, shape: tuple[int, int]) -> tuple[F4, F4]:
    """Return the columns and rows where the camera sees each ideal pixel, H x W each."""
    return _moved(lens, shape, camera_offset)


def ideal_places(lens: Lens, shape: tuple[int, int], step: int = 1) -> tuple[F4, F4]:
    """Return the columns and rows of the ideal grid that the camera's pixels see."""
    return _moved(lens, shape, ideal_offset, step)


def _moved(lens: Lens, shape: tuple[int, int], offset: Any, step: int = 1) -> tuple[F4, F4]:
    rows, columns = shape
    half = half_diagonal(shape)
    row, column = np.mgrid[:rows:step, :columns:step].astype(np.float32)
    scale = np.float32(1) / half
    u = (column - np.float32(0.5) * np.float32(columns - 1)) * scale
    v = (row - np.float32(0.5) * np.float32(rows - 1)) * scale
    du, dv = offset(lens, u, v)
    return column + half * du, row + half * dv


def nearest_ideal(lens: Lens, shape: tuple[int, int]) -> tuple[I4, I4]:
    """Return row and column of the ideal pixel nearest to the place that each pixel sees."""
    rows, columns = shape
    x, y = ideal_places(lens, shape)
    column = np.clip(x, np.float32(0), np.float32(columns - 1)) + np.float32(0.5)
    row = np.clip(y, np.float32(0), np.float32(rows - 1)) + np.float32(0.5)
    return row.astype(np.int32), column.astype(np.int32)
