"""Convert the height that a camera near the film sees to the film's height, and back."""

import numpy as np

from tactograph.graph import Close, node
from tactograph.nodes import Height, Vergence
from tactograph.nodes.slope.view_slope import is_orthographic


@node(neutral="height", tolerance=Close(1e-6, 1e-6, why="division"))
def undo_perspective(
    height: Height, camera: Vergence, rest: Height | None = None, *, inverse: bool = False
) -> Height:
    """Return z = Z / (1 + Z / D) of the seen height Z (see `view_slope`), or the `inverse`.

    Parameters
    ----------
    height : H x W in mm, the seen height
    camera : 1 / D in 1/mm
    rest
        H x W in mm, the seen height (with `inverse` the height) of the film at rest, to which
        heights are relative.  None: a plane.
    inverse : return the seen height Z = z / (1 - z / D) of a pixel that sees height z

    Returns
    -------
    H x W in mm, the height above the film at rest of what each pixel sees (V1).
    """
    by = np.float32(-camera if inverse else camera)
    if rest is None:
        return np.asarray(height / (1 + by * height), np.float32)
    whole = height + rest
    return np.asarray(whole / (1 + by * whole) - rest / (1 + by * rest), np.float32)


undo_perspective.opencl(grid="H W", lanes="grid")
undo_perspective.idle(is_orthographic)
