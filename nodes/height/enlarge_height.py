"""Bring a coarse height back to full resolution."""

from tactograph.graph import node
from tactograph.nodes import CoarseHeight, Height, Light
from tactograph.nodes.optics.between_cells import between_cells
from tactograph.nodes.optics.cell_side import CellSide, cell_side, cells_by


@node(derived=cells_by("factor"))
def enlarge_height(
    height: CoarseHeight, like: Light, onto: Height | None = None, *, factor: CellSide = 4
) -> Height:
    """Interpolate linearly between the cells of `coarsen`, and add the result to a height.

    Parameters
    ----------
    height : h x w in mm, one value per cell
    like : K x H x W; gives the size of the result
    onto : H x W in mm, the height to add to; None: zero
    factor : side of a cell in pixels, as for `coarsen`
    """
    _count, rows, columns = like.shape
    large = between_cells(height, (rows, columns), cell_side(rows, columns, factor))
    return large if onto is None else large + onto


enlarge_height.opencl(grid="H W", lanes="rows", integers="like")
