"""The pixel of a coarser image."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Interval

from tactograph.graph import node
from tactograph.nodes import PixelSize


@node
def coarsen_pixel(
    pixel: PixelSize, *, factor: Annotated[int, Interval(ge=1, le=64)] = 4
) -> PixelSize:
    """Return the side of a cell of ``factor`` by ``factor`` pixels in mm; see `coarsen`.

    Parameters
    ----------
    pixel
        mm per pixel.
    factor
        Pixels along the side of a cell.
    """
    return pixel * factor
