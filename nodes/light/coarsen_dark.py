"""Coarsen the dark image."""

from tactograph.graph import node
from tactograph.nodes import CoarseDark, Dark
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.optics.cell_side import CellSide, cells_by


@node(derived=cells_by("factor"))
def coarsen_dark(dark: Dark, *, factor: CellSide = 4) -> CoarseDark:
    """Return the mean of every cell of ``factor`` by ``factor`` pixels; see `coarsen`.

    Parameters
    ----------
    dark : H x W, all LEDs off
    factor : side of a cell in pixels, as for `coarsen`

    Returns
    -------
    h x w, with h = H / factor and w = W / factor, rounded up.
    """
    return coarsen(dark[None], factor=factor)[0]
