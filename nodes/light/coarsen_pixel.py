"""The pixel of a coarser image."""

from __future__ import annotations

from tactograph.graph import node
from tactograph.nodes import Light, PixelSize
from tactograph.nodes.light._cell_side import CellSide, cell_side


@node
def coarsen_pixel(pixel: PixelSize, like: Light, *, factor: CellSide = 0) -> PixelSize:
    """Return the side of a cell of ``factor`` by ``factor`` pixels in mm; see `coarsen`.

    Parameters
    ----------
    pixel
        mm per pixel.
    like
        K x H x W, the image whose cells they are; nothing but its size is read.
    factor
        Pixels along the side of a cell, as for `coarsen`.
    """
    _count, rows, columns = like.shape
    return pixel * cell_side(rows, columns, factor)
