"""Correct single pixels that stand out where the slopes are uncertain."""

import numpy as np

from tactograph.graph import Close, node
from tactograph.nodes import F4, Height, SlopeVariance

LOOSE_VARIANCE = np.float32(0.2)
"""Variance (mm/mm)^2 above which a pixel's own slopes carry little information."""


@node(neutral="height", tolerance=Close(1e-6, 1e-6))
def settle_loose(height: Height, variance: SlopeVariance) -> Height:
    """Move loose pixels towards their neighbours.

    A pixel is loose if it lies above (or below) the mean of its two neighbours along all four lines
    through it; it moves by the smallest of the four differences.  A ridge stays, since it stands
    out along three lines only.

    Parameters
    ----------
    height : H x W in mm; beyond the frame the border repeats
    variance : 2 x H x W; only pixels whose variances both exceed `LOOSE_VARIANCE` move
    """
    padded = np.pad(height, 1, mode="edge")
    lines = [_departure(padded, dy, dx) for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1))]
    least = np.maximum(np.min(lines, axis=0), 0) + np.minimum(np.max(lines, axis=0), 0)
    moves = np.minimum(variance[0], variance[1]) > LOOSE_VARIANCE
    return np.asarray(np.where(moves, height - least, height), np.float32)


def _departure(padded: F4, dy: int, dx: int) -> F4:
    """Height above the mean of the neighbours at (dy, dx) and opposite."""
    rows, columns = padded.shape[0] - 2, padded.shape[1] - 2

    def shifted(down: int, right: int) -> F4:
        return padded[1 + down : 1 + down + rows, 1 + right : 1 + right + columns]

    return np.asarray(shifted(0, 0) - 0.5 * (shifted(dy, dx) + shifted(-dy, -dx)))


settle_loose.opencl(grid="H W", lanes="rows")
