"""Convert the slope of a pixel's mean normal to the pixel's mean slope."""

from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.graph import Close, node
from tactograph.nodes import F4, Slope
from tactograph.nodes.optics.cache_blocks import in_blocks
from tactograph.nodes.optics.difference import difference, second_differences

PIXEL_VARIANCE = np.float32(1 / 12)
MAX_CORRECTION = 0.05
"""Largest correction of a slope, in units of 1 + p^2 + q^2; across edges expansions fail."""


@node(neutral="slope", tolerance=Close(2e-5, 2e-5, why="differences of rounded normals"))
def pixel_mean_slope(
    slope: Slope,
    *,
    most: Annotated[float, Interval(ge=0, le=1)] = MAX_CORRECTION,
    inverse: bool = False,
) -> Slope:
    """Correct slopes for the change of the normal within a pixel.

    A pixel gathers the light of its whole area, so its light gives the mean normal.  The step of
    height across a pixel, however, is its mean slope.  With n' the change of the normal per pixel
    along an axis and p = -n_x / n_z, the mean slope exceeds the slope of the mean normal to second
    order by (n'_x n'_z + p n'_z^2) / (12 n_z^2), summed over both axes; likewise for q
    (equation V4).

    `inverse` starts from the differences of a known height over two pixels (`height_slopes`), and
    gives the slopes of the mean normals, as light shows them.  With p'' the second difference of p,
    these differences exceed the pixel's mean slope by p'' / 8 along their own axis (1/6 - 1/24 of
    the third derivative), and fall short of it by p'' / 24 along the other.

    Parameters
    ----------
    slope : 2 x H x W in mm per mm, of the mean normal
    most : largest correction, in units of 1 + p^2 + q^2
    inverse : convert differences over two pixels to slopes of the mean normal
    """
    rows, columns = slope.shape[1:]
    corrected = np.empty_like(slope)

    def correct(part: slice) -> None:
        around = slice(max(part.start - 1, 0), part.stop + 1)
        inner = slice(part.start - around.start, part.stop - around.start)
        corrected[:, part] = _corrected(slope[:, around], inner, np.float32(most), inverse)

    in_blocks(correct, rows, columns)
    return corrected


def _corrected(slope: F4, rows: slice, most: np.float32, inverse: bool) -> F4:
    """The corrected slopes of `rows`; rows beside them are read as neighbours."""
    p, q = around = slope
    square = 1 + p * p + q * q
    nz = 1 / np.sqrt(square)
    normal = np.stack([-p * nz, -q * nz, nz])
    slope, square = slope[:, rows], square[rows]
    add = np.zeros_like(slope)
    for axis in (1, 2):
        change = difference(normal, axis)[:, rows]
        along, dz = change[:2], change[2]
        add += dz * (along + slope * dz)
    limit = most * square
    add *= square * PIXEL_VARIANCE
    if inverse:
        add = _beyond_differences(around)[:, rows] - add
    return slope + np.clip(add, -limit, limit)


def _beyond_differences(slope: F4) -> F4:
    """The mean slopes of the pixels minus the differences over two pixels."""
    (p_across, p_along), (q_across, q_along) = map(second_differences, slope)
    third = np.float32(3)
    return np.stack([p_along - third * p_across, q_across - third * q_along]) * (PIXEL_VARIANCE / 2)


pixel_mean_slope.opencl(grid="H W", lanes="rows")
