"""Interpolate values of cells at pixels, linearly between the cells' centres."""

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4


def between_cells(cells: F4, size: tuple[int, ...], factor: int) -> F4:
    """Interpolate ... x h x w cells of `factor` x `factor` pixels at ... x H x W pixels."""
    above, below, down = _neighbours(size[0], cells.shape[-2], factor)
    left, right, across = _neighbours(size[1], cells.shape[-1], factor)
    wide = _mixed(cells[..., left], cells[..., right], across)
    return _mixed(wide[..., above, :], wide[..., below, :], down[:, None])


def _neighbours(
    count: int, cells: int, factor: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], F4]:
    """The two cells whose centres enclose each pixel, and its distance from the first."""
    place = (np.arange(count, dtype=np.float32) + np.float32(0.5)) / np.float32(factor)
    place = np.clip(place - np.float32(0.5), np.float32(0), np.float32(cells - 1))
    first = place.astype(np.intp)
    return first, np.minimum(first + 1, cells - 1), place - first.astype(np.float32)


def _mixed(a: F4, b: F4, share: F4) -> F4:
    return a + (b - a) * share
