"""The mean slope over a pixel, from the slope of its mean normal."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.graph import Close, node
from tactograph.nodes import F4, Slope

TWELFTH = np.float32(1 / 12)


@node(neutral="slope", tolerance=Close(2e-5, 2e-5, why="differences of rounded normals"))
def pixel_mean_slope(slope: Slope, *, most: Annotated[float, Interval(ge=0, le=1)] = 0.05) -> Slope:
    """Correct slopes for the change of the normal within a pixel.

    A pixel gathers the light of its whole area, so its lights give the mean normal, whereas
    a step of height is the mean slope.  With n' the change of the normal per pixel along an
    axis, Jensen's inequality to second order says, for p = -n_x / n_z, that the mean slope
    exceeds the slope of the mean normal by (n'_x n'_z + p n'_z^2) / (12 n_z^2), summed over
    both axes; the same for q.

    Parameters
    ----------
    slope
        2 x H x W.
    most
        Largest correction, in units of 1 + p^2 + q^2; across edges the expansion fails.
    """
    p, q = slope
    square = np.float32(1) + p * p + q * q
    nz = np.float32(1) / np.sqrt(square)
    add_p, add_q = np.zeros_like(p), np.zeros_like(p)
    for axis in (0, 1):
        dx, dy, dz = (_difference(part, axis) for part in (-p * nz, -q * nz, nz))
        add_p += (dx * dz + p * dz * dz) * square * TWELFTH
        add_q += (dy * dz + q * dz * dz) * square * TWELFTH
    limit = np.float32(most) * square
    corrected = [p + np.clip(add_p, -limit, limit), q + np.clip(add_q, -limit, limit)]
    return np.asarray(np.stack(corrected), np.float32)


def _difference(plane: F4, axis: int) -> F4:
    """Change per pixel along `axis`: central, one-sided at the ends."""
    index = np.arange(plane.shape[axis])
    after = np.minimum(index + 1, index[-1])
    before = np.maximum(index - 1, 0)
    span = np.maximum(after - before, 1).astype(np.float32)
    shape = (-1, 1) if axis == 0 else (1, -1)
    return np.asarray((plane.take(after, axis) - plane.take(before, axis)) / span.reshape(shape))


pixel_mean_slope.opencl(grid="H W")
