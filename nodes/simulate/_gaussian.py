"""A Gaussian filter."""

import math

import numpy as np
from scipy.ndimage import correlate1d

from tactograph.graph.backends.launch import DeviceArray, Launch
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


def smoothed(planes: F4, deviation_px: float) -> F4:
    """Filter planes K x H x W along rows and columns; border values are replicated."""
    weights = gaussian(deviation_px)
    for axis in (2, 1):
        planes = correlate1d(planes, weights, axis, mode="nearest")
    return planes


def launch_smoothed(
    run: Launch, planes: DeviceArray, out: DeviceArray, size: tuple[int, ...], deviation_px: float
) -> None:
    """Enqueue `smoothed` by the kernel of ``spread.clh``; `size` is K, H, W."""
    weights = gaussian(deviation_px)
    taps = run.keep(weights.tobytes(), lambda: run.put(weights))
    half, radius = run.scratch(size), len(weights) // 2
    run.kernel("spread", size, planes, taps, half, *size, radius, 1)
    run.kernel("spread", size, half, taps, out, *size, radius, 0)
