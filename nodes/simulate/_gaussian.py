"""A Gaussian filter along an axis."""

from __future__ import annotations

import math

import numpy as np

from tactograph.nodes import F4

CUTOFF_SIGMAS = 4.0
"""The Gaussian is cut off at this many standard deviations."""
NARROWEST_PX = 0.01
"""Below this standard deviation, neighbouring pixels have no weight."""


def gaussian(deviation_px: float) -> F4:
    """Return weights of sum 1, or a single 1 if the Gaussian is too narrow to matter."""
    radius = math.ceil(CUTOFF_SIGMAS * deviation_px) if deviation_px > NARROWEST_PX else 0
    distance = np.arange(-radius, radius + 1)
    weights = np.exp(-0.5 * (distance / max(deviation_px, NARROWEST_PX)) ** 2)
    return np.asarray(weights / weights.sum(), np.float32)


def smoothed(planes: F4, weights: F4, axis: int) -> F4:
    """Filter along an axis; border values are replicated."""
    radius, size = len(weights) // 2, planes.shape[axis]
    around = [(0, 0)] * planes.ndim
    around[axis] = (radius, radius)
    wide = np.pad(planes, around, mode="edge")
    total = np.zeros_like(planes)
    for i, weight in enumerate(weights):
        total += weight * wide.take(range(i, i + size), axis)
    return total
