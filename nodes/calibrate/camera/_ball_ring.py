"""The film around a pressed ball, by sectors and by distance from the ball."""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F8

SECTOR_COUNT = 24
"""Number of sectors around a ball; an edge within one is a piece of a circle."""


class BallRing(NamedTuple):
    """The pixels of a ring, N: where they are, and the cell of each, a pixel wide in its sector."""

    inside: NDArray[np.bool_]
    """H x W"""
    outward: F8
    """2 x N, the direction away from the ball."""
    distance: F8
    """N, px beyond the ring's inner radius."""
    sector: NDArray[np.intp]
    bin: NDArray[np.intp]
    bin_count: int

    @classmethod
    def of(
        cls, shape: tuple[int, ...], middle: tuple[float, float], first: float, last: float
    ) -> Self:
        """Return the pixels of an H x W image between two distances from `middle` (x, y), in px."""
        y, x = np.indices(shape)
        dx, dy = x - middle[0], y - middle[1]
        away = np.hypot(dx, dy)
        inside = (away > first) & (away < last)
        turn = np.arctan2(dy[inside], dx[inside])
        sector = np.floor(turn / (2 * np.pi) * SECTOR_COUNT).astype(int) % SECTOR_COUNT
        distance = away[inside] - first
        outward = np.stack([np.cos(turn), np.sin(turn)])
        number = distance.astype(int)
        return cls(inside, outward, distance, sector, number, int(last - first) + 1)

    @property
    def cell(self) -> NDArray[np.intp]:
        """The number of each pixel's cell, sector by sector."""
        return self.sector * self.bin_count + self.bin

    @property
    def counts(self) -> NDArray[np.intp]:
        """The number of pixels in each cell, sectors x bins."""
        counts = np.bincount(self.cell, minlength=SECTOR_COUNT * self.bin_count)
        return counts.reshape(SECTOR_COUNT, -1)

    def mean(self, values: F8) -> F8:
        """The mean of each cell, sectors x bins; 0 where a cell has no pixel."""
        sums = np.bincount(self.cell, values, SECTOR_COUNT * self.bin_count)
        return sums.reshape(SECTOR_COUNT, -1) / np.maximum(self.counts, 1)
