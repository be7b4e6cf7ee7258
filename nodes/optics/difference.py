"""Differences between neighbouring pixels."""

import numpy as np

from tactograph.nodes import F4


def difference(z: F4, axis: int) -> F4:
    """Central difference per pixel along `axis`; one-sided at the ends, zero for one pixel."""
    return np.asarray(np.gradient(z, axis=axis) if z.shape[axis] > 1 else np.zeros_like(z))


def second_differences(plane: F4) -> tuple[F4, F4]:
    """Return the second differences of H x W values along x and along y; the border repeats."""
    around = np.pad(plane, 1, mode="edge")
    across = around[1:-1, 2:] - 2 * plane + around[1:-1, :-2]
    return across, around[2:, 1:-1] - 2 * plane + around[:-2, 1:-1]
