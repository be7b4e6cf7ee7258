"""Make slopes relative to the film at rest."""

from tactograph.graph import node
from tactograph.nodes import Slope


@node(neutral="slope")
def slope_from_rest(slope: Slope, tilt: Slope | None = None, *, inverse: bool = False) -> Slope:
    """Subtract the slopes of the film at rest; what remains integrates to the height above it.

    Parameters
    ----------
    slope : 2 x H x W, of the seen height
    tilt : 2 x H x W, of the seen height of the film at rest; None: a plane
    inverse : whether to add `tilt` to slopes relative to the film at rest instead
    """
    if tilt is None:
        return slope
    return slope + tilt if inverse else slope - tilt


slope_from_rest.opencl(grid="H W", lanes="grid")
slope_from_rest.idle(lambda tilt=None: True)  # asked only without `tilt`
