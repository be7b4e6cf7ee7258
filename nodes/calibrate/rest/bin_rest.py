"""The film's shape at rest on the binned pixels of a calibration."""

from tactograph.graph import node
from tactograph.nodes.optics.rest_shape import RestShape


@node
def bin_rest(factor: int, shape: RestShape | None = None) -> RestShape | None:
    """Return the means over cells, as `bin_presses` bins images; None for a plane.

    Parameters
    ----------
    factor : side of a cell in pixels
    shape : as `read_rest` returns it
    """
    return None if shape is None else shape.binned(factor)
