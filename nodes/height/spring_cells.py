"""A network of springs on cells of 2 x 2 pixels, for loads whose effect is smooth.

Blocks of rigidly joined pixels (`springs`) are too stiff for more than a preconditioner.  Here the
springs between the middles of two cells are in series in each row of pixels, and the two rows are
in parallel, so that cells move like the mean of their pixels.
``kernels/headers/spring_cells.clh`` is the same on a device.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4
from tactograph.nodes.height.springs import Springs, pair_sums, quad_sums

MIN_STIFFNESS = np.float32(1e-12)
"""Lower bound on a stiffness in a denominator."""


class Cells(NamedTuple):
    """Cells of 2 x 2 pixels of a network of `shape`, and the stiffness of their parts."""

    springs: Springs
    shape: tuple[int, ...]
    in_rows: F4
    """H x w-1, the stiffness in each row of pixels."""
    in_columns: F4
    """h-1 x W, the stiffness in each column."""
    which: NDArray[np.int64]
    """For each tie between pixels, the tie of cells that it joins; -1 if within one cell."""
    ties: F4
    """The stiffness of the ties between pixels."""

    def wants(self, right: F4, down: F4, rise: F4) -> tuple[F4, F4, F4]:
        """The target steps and rises between cells, from those between pixels."""
        stretch = pair_sums(self.in_rows * _one_by_one(right))
        stretch_down = pair_sums((self.in_columns * _one_by_one(down.T).T).T).T
        apart, springs = self.which >= 0, self.springs
        joined = np.bincount(
            self.which[apart], (self.ties * rise)[apart], springs.ties.stiffness.size
        ).astype(np.float32)
        right, down = stretch / springs.right, stretch_down / springs.down
        return right, down, joined / springs.ties.stiffness

    def on_pixels(self, plane: F4) -> F4:
        """The cells' values at the pixels, interpolated linearly between the cells' middles."""
        rows, columns = plane.shape
        size = 2 * columns, 2 * rows
        fine = cv2.resize(plane, size, interpolation=cv2.INTER_LINEAR)
        return np.ascontiguousarray(fine[: self.shape[0], : self.shape[1]])


def cells_of(springs: Springs) -> Cells:
    """Return the network on cells of 2 x 2 pixels."""
    in_rows = _in_series(springs.right)
    in_columns = np.ascontiguousarray(_in_series(springs.down.T).T)
    ground = quad_sums(springs.ground)
    ties, which = springs.ties.joined(springs.shape[1], ground.shape)
    down = np.ascontiguousarray(pair_sums(in_columns.T).T)
    network = Springs(pair_sums(in_rows), down, ground, ties)
    return Cells(network, springs.shape, in_rows, in_columns, which, springs.ties.stiffness)


def _in_series(stiffness: F4) -> F4:
    """The stiffness of half a spring, a whole one and half of the next in series, along a row.

    In a row of odd length, the spring beyond the last pixel is rigid.
    """
    gives = np.asarray(np.float32(1) / np.maximum(stiffness, MIN_STIFFNESS), np.float32)
    return np.asarray(np.float32(1) / _one_by_one(gives), np.float32)


def _one_by_one(steps: F4) -> F4:
    """The steps between the cells of a row: half a step, a whole one and half of the next."""
    if steps.shape[1] % 2 == 0:
        steps = np.pad(steps, ((0, 0), (0, 1)))
    first, middle, last = steps[:, 0:-1:2], steps[:, 1::2], steps[:, 2::2]
    return np.asarray(np.float32(0.5) * first + middle + np.float32(0.5) * last, np.float32)
