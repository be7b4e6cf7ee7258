"""Coarsen an image: average it over square cells."""

from typing import Literal

import numpy as np

from tactograph.graph import node
from tactograph.nodes import F4, CoarseLight, Light
from tactograph.nodes.optics.cell_side import CellSide, cell_side, cells_by


@node(derived=cells_by("factor"))
def coarsen(
    light: Light,
    *,
    factor: CellSide = 4,
    sample: Literal["mean", "corner"] = "mean",
) -> CoarseLight:
    """Return the mean, or one pixel, of every cell of ``factor`` by ``factor`` pixels.

    A height that only serves for the direction of the light needs no full resolution.  Cells that
    extend beyond the right or bottom border repeat the border pixels.

    Parameters
    ----------
    light : K x H x W
    factor : side of a cell in pixels; 0: 4, or 8 for a large image (`cell_side`)
    sample
        ``corner`` takes only the first pixel of a cell.  That reads far less, and suffices for a
        quantity that varies as little as the standard deviation of noise.

    Returns
    -------
    K x h x w, with h = H / factor and w = W / factor, rounded up.
    """
    _count, rows, columns = light.shape
    factor = cell_side(rows, columns, factor)
    if sample == "corner":
        return np.ascontiguousarray(light[:, ::factor, ::factor])
    beyond = -rows % factor, -columns % factor
    if any(beyond):
        light = np.pad(light, ((0, 0), (0, beyond[0]), (0, beyond[1])), mode="edge")
    sums = light[:, ::factor].copy()
    for row in range(1, factor):
        sums += light[:, row::factor]
    total: F4 = sums[..., ::factor].copy()
    for column in range(1, factor):
        total += sums[..., column::factor]
    return total * np.float32(1 / factor**2)


coarsen.opencl(grid="K h w", lanes="rows", integers="light")
