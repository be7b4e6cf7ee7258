"""Bring a coarse height back to full resolution."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Interval

from tactograph.graph import Parts, node
from tactograph.nodes import CoarseHeight, Height, Light
from tactograph.nodes.light._between_cells import between_cells


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
    return between_cells(height, like.shape[1:], factor)


enlarge_height.opencl(grid="H W", lanes="rows")
