"""Set the height of the frame's border, which shows the film at rest, to zero."""

from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.graph import node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import Height
from tactograph.nodes.light.border import border_of


@node(neutral="height")
def rest_at_border(
    height: Height, *, width_px: Annotated[int, Interval(ge=1, le=64)] = 3
) -> Height:
    """Subtract the (lower) median of the outermost pixels.

    Slopes determine the height up to a constant; the paper's Table 1 sets the plane around the
    object to zero.  The median is valid as long as the object covers less than half of the frame's
    border.

    Parameters
    ----------
    height : H x W in mm
    width_px : width of the border in px
    """
    border = border_of(height, width_px)
    middle = (border.size - 1) // 2
    return height - np.partition(border, middle)[middle]


@rest_at_border.opencl()
def _launch(run: Launch) -> None:
    height, out = run.inputs["height"], run.outputs["rest_at_border"]
    rows, columns = run.sizes["H"], run.sizes["W"]
    border = int(run.settings["width_px"])
    inner = max(rows - 2 * border, 0) * max(columns - 2 * border, 0)
    values, median = run.scratch((rows * columns - inner,)), run.scratch((1,))
    group = (run.group,)
    run.kernel("border_median", group, height, values, median, rows, columns, border, local=group)
    run.kernel("subtract", run.in_lanes(rows, columns), height, median, out, rows, columns)
