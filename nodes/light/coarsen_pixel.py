"""Find the pixel size of a coarser image."""

from tactograph.graph import InputError, node
from tactograph.nodes import Light, PixelSize
from tactograph.nodes.optics.cell_side import CellSide, cell_side


@node
def coarsen_pixel(
    pixel: PixelSize, like: Light | None = None, *, factor: CellSide = 4
) -> PixelSize:
    """Return the side of a cell of ``factor`` by ``factor`` pixels in mm; see `coarsen`.

    Parameters
    ----------
    pixel : mm per pixel
    like
        K x H x W, the image that is divided into cells; its size is needed if the factor is 0.
    factor : pixels along the side of a cell, as for `coarsen`

    Raises
    ------
    InputError
        If the factor is 0 and no image is given.
    """
    if factor:
        return pixel * factor
    if like is None:
        raise InputError("`factor`=0 depends on the image size; give the image as `like`")
    _count, rows, columns = like.shape
    return pixel * cell_side(rows, columns, factor)
