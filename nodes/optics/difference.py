"""Differences between neighbouring pixels."""

import numpy as np

from tactograph.nodes import F4


def difference(z: F4, axis: int) -> F4:
    """Central difference per pixel along `axis`; one-sided at the ends, zero for one pixel."""
    index = np.arange(z.shape[axis])
    after = np.minimum(index + 1, index[-1])
    before = np.maximum(index - 1, 0)
    span = np.maximum(after - before, 1).astype(np.float32)
    shape = (-1, 1) if axis == 0 else (1, -1)
    return (z.take(after, axis) - z.take(before, axis)) / span.reshape(shape)


def second_differences(plane: F4) -> tuple[F4, F4]:
    """Return the second differences of H x W values along x and along y; the border repeats."""
    around = np.pad(plane, 1, mode="edge")
    across = around[1:-1, 2:] - 2 * plane + around[1:-1, :-2]
    return across, around[2:, 1:-1] - 2 * plane + around[:-2, 1:-1]
