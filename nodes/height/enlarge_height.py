"""Bring a coarse height back to full resolution."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.graph import Parts, node
from tactograph.nodes import F4, CoarseHeight, Height, Light


@node(derived={"h": Parts("H", by="factor"), "w": Parts("W", by="factor")})
def enlarge_height(
    height: CoarseHeight, like: Light, *, factor: Annotated[int, Interval(ge=1, le=64)] = 4
) -> Height:
    """Interpolate linearly between the cells that `coarsen` made.

    Parameters
    ----------
    height
        h x w in mm, one value per cell.
    like
        K x H x W; its size is that of the result, nothing else of it is read.
    factor
        Side of a cell in pixels.
    """
    rows, columns = like.shape[1:]
    above, below, down = _between(rows, height.shape[0], factor)
    left, right, across = _between(columns, height.shape[1], factor)
    wide = _mixed(height[:, left], height[:, right], across)
    return _mixed(wide[above], wide[below], down[:, None])


def _between(count: int, cells: int, factor: int) -> tuple[NDArray[np.intp], NDArray[np.intp], F4]:
    """The cells whose centres a pixel lies between, and how far from the first."""
    place = (np.arange(count, dtype=np.float32) + np.float32(0.5)) / np.float32(factor)
    place = np.clip(place - np.float32(0.5), np.float32(0), np.float32(cells - 1))
    first = place.astype(np.intp)
    return first, np.minimum(first + 1, cells - 1), place - first.astype(np.float32)


def _mixed(a: F4, b: F4, share: F4) -> F4:
    return a + (b - a) * share


enlarge_height.opencl(grid="H W")
