"""The corners of a checkerboard, where four of its squares meet."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates, maximum_filter

from tactograph.rings.camera.nodes._dots import reduced
from tactograph.rings.camera.nodes._lattice import Lattice, on_lattice
from tactograph.sdk import F4

SMOOTHING_PX = (1.5, 3.0)
"""Standard deviations in px of the smoothing before saddles are searched for."""
MIN_SADDLE_SHARE = 0.15
"""Smallest strength of a saddle, relative to the strongest ones."""
WINDOW_PITCHES = 0.3
"""Half the window in which a corner is measured, relative to the pitch."""
DARK_SHARES = (0.35, 0.65)
"""Bounds of the dark share of a checkerboard."""

Points = NDArray[Any]


def find_corners(image: F4) -> Lattice | None:
    """Return the corners that lie on one lattice, in px; None if there are not enough."""
    small, factor = reduced(image)
    lattices = [on_lattice(_saddles(small, sigma)) for sigma in SMOOTHING_PX]
    largest = max(filter(None, lattices), key=lambda lattice: len(lattice.place), default=None)
    if largest is None or not DARK_SHARES[0] < _dark_part(small, largest) < DARK_SHARES[1]:
        return None
    half = int(np.clip(WINDOW_PITCHES * largest.pitch * factor, 2, 40))
    levels = np.clip(255 * image / image.max(), 0, 255).astype(np.uint8)
    rough = np.ascontiguousarray(factor * (largest.place + 0.5) - 0.5, np.float32)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)
    return on_lattice(cv2.cornerSubPix(levels, rough, (half, half), (-1, -1), stop))


def _saddles(image: F4, sigma: float) -> Points:
    """The points where the image's principal second derivatives most strongly differ in sign."""
    xx, yy, xy = (gaussian_filter(image, sigma, order=o) for o in ((0, 2), (2, 0), (1, 1)))
    strength = xy * xy - xx * yy
    margin = int(np.ceil(3 * sigma))
    inner = np.zeros(image.shape, bool)
    inner[margin:-margin, margin:-margin] = True
    strongest = np.percentile(strength[inner], 99.5) if inner.any() else 0
    peaks = inner & (strength == maximum_filter(strength, 2 * margin + 1))
    y, x = np.nonzero(peaks & (strength > MIN_SADDLE_SHARE * strongest))
    return np.stack([x, y], axis=1).astype(np.float64)


def _dark_part(image: F4, lattice: Lattice) -> float:
    """The share of the lattice's cells that is darker than the mean of dark and bright."""
    where = {tuple(cell): place for cell, place in zip(lattice.cell, lattice.place, strict=True)}
    parts = []
    share = np.linspace(0.1, 0.9, 9)
    across, down = (grid.ravel()[:, None] for grid in np.meshgrid(share, share))
    for (i, j), place in where.items():
        right, below = where.get((i + 1, j)), where.get((i, j + 1))
        if right is not None and below is not None:
            inside = place + across * (right - place) + down * (below - place)
            parts.append(map_coordinates(image, inside[:, ::-1].T, order=1, mode="nearest"))
    if not parts:
        return 0.0
    means = np.array([part.mean() for part in parts])
    middle = (np.percentile(means, 10) + np.percentile(means, 90)) / 2
    return float(np.mean(np.concatenate(parts) < middle))
