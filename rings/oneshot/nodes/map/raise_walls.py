"""Give steep edges back what punches of known depth show that they lack."""

from typing import Annotated

import numpy as np

from tactograph.sdk import F4, Port, Slope, node
from tactograph.sdk.nodes import edge_variance

WallGain = Annotated[float, Port(unit="1")]
"""Multiple of what second order says that blurred edges lack, as `judge_punches` finds it."""
BLUR_PX = 1.0
"""Standard deviation of the usual blur of a lens; a gain stands for any other."""
MIN_SLOPE = np.float32(1e-3)
"""Slope in whose direction uphill is not known."""


@node(neutral="slope")
def raise_walls(slope: Slope, gain: WallGain) -> Slope:
    """Return the slope with `gain` times what an edge lacks, uphill (equation W3).

    Film that bends little, as over a ball, lacks next to nothing.

    Parameters
    ----------
    slope : 2 x H x W
    gain : 0 where no punch was pressed
    """
    if gain == 0:
        return slope
    lack = np.float32(gain) * edge_lack(slope)
    return np.asarray(slope + lack * uphill(slope), np.float32)


def edge_lack(slope: Slope) -> F4:
    """By how much light blurred over an edge shows less than its mean slope, H x W."""
    lack = edge_variance(np.zeros_like(slope), slope, BLUR_PX, factor=1.0)
    return np.asarray(np.sqrt(lack[0]), np.float32)


def uphill(slope: Slope) -> F4:
    """The direction of the slope, 2 x H x W; next to nothing where film is level."""
    return np.asarray(slope / np.maximum(np.hypot(*slope), MIN_SLOPE), np.float32)
