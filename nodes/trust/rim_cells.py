"""Find cells whose rise light cannot measure."""

from typing import Any

import numpy as np

from tactograph.graph import node
from tactograph.nodes import Labels, Mask, Slope
from tactograph.nodes.trust.checked_cells import MIN_LEDS

MAX_TURN = np.float32(1.25)
"""Change of the slope from cell to cell beyond which a cell contains an edge and shows the mean of
both sides.  The rim is the side that is at least that steep."""


@node
def rim_cells(slope: Slope, used: Labels) -> Mask:
    """Mark rims: cells that are steeper than a cell can show, or lit by too few LEDs.

    A cell is a rim if its slope is above `MAX_TURN` and changes by more than that towards one of
    its four neighbours.

    Parameters
    ----------
    slope, used : 2 x H x W and H x W, on cells, from `label_lights`
    """
    edge = np.zeros(used.shape, bool)
    across, down = (_squares(np.diff(slope, axis=axis)) > MAX_TURN * MAX_TURN for axis in (2, 1))
    for side in (edge[:, 1:], edge[:, :-1]):
        side |= across
    for side in (edge[1:], edge[:-1]):
        side |= down
    rim = edge & (_squares(slope) > MAX_TURN * MAX_TURN)
    return (rim | (np.bitwise_count(used) < MIN_LEDS)).view(np.uint8)


def _squares(slope: Slope) -> Any:
    p, q = slope
    return p * p + q * q


rim_cells.opencl(grid="H W", lanes="rows")


@rim_cells.example
def _example(rng: np.random.Generator, H: int, W: int, **_: int) -> dict[str, Any]:
    """Slopes that change abruptly in places, and shadows of a few LEDs."""
    slope = rng.normal(0, 0.8, (2, H, W)).astype(np.float32)
    used = rng.choice([15, 14, 12, 9], (H, W), p=[0.7, 0.1, 0.1, 0.1]).astype(np.uint8)
    return {"slope": slope, "used": used}
