"""Convert between the height above the film at rest and the absolute height."""

from tactograph.graph import node
from tactograph.nodes import Height


@node(neutral="height")
def add_rest(height: Height, rest: Height | None = None, *, inverse: bool = False) -> Height:
    """Add the height of the film at rest, or subtract it.

    Parameters
    ----------
    height : H x W in mm, above the film at rest; with `inverse` the absolute height
    rest : H x W in mm, the film at rest; None: a plane
    inverse : whether `rest` is subtracted
    """
    if rest is None:
        return height
    return height - rest if inverse else height + rest


add_rest.opencl(grid="H W", lanes="grid")
add_rest.idle(lambda rest=None: True)  # asked only without `rest`
