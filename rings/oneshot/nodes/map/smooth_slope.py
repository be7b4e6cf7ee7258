"""Take some noise out of the slope."""

import numpy as np

from tactograph.sdk import F4, Close, Launch, Slope, node

BINOMIAL_WEIGHTS = (0.0625, 0.25, 0.375, 0.25, 0.0625)
"""Binomial: close to a Gaussian of one pixel's standard deviation."""
ITEM_ROWS = 4
"""Rows per work-item of the kernel."""


@node(neutral="slope", tolerance=Close(1e-6, 1e-6, why="a sum of 25 terms"))
def smooth_slope(slope: Slope) -> Slope:
    """Return the slope averaged over 5 x 5 pixels with binomial weights (1 4 6 4 1) / 16.

    A sensor with three lights has no redundancy to check a slope against, and at 8 bits its
    noise amounts to a degree of slope.  A mean of slopes keeps the height of a wall; light that
    is averaged over an edge shows less, since it is not linear in the slope.  Beyond the frame
    the border repeats.

    Parameters
    ----------
    slope : 2 x H x W
    """
    return _along(_along(slope, 2), 1)


def _along(slope: F4, axis: int) -> F4:
    """Average along one axis."""
    last = slope.shape[axis] - 1
    at = np.arange(slope.shape[axis])
    total = np.zeros_like(slope)
    for shift, tap in enumerate(BINOMIAL_WEIGHTS, -2):
        total = total + np.float32(tap) * np.take(slope, np.clip(at + shift, 0, last), axis)
    return np.asarray(total, np.float32)


@smooth_slope.opencl()
def _launch(run: Launch) -> None:
    """Each work-item computes `ITEM_ROWS` rows."""
    rows, columns = (run.sizes[name] for name in "HW")
    arguments = run.inputs["slope"], run.outputs["smooth_slope"], rows, columns
    grid = run.in_row_lanes(2, -(-rows // ITEM_ROWS), columns)
    run.kernel("smooth_slope", grid, *arguments, constants={"ITEM_ROWS": ITEM_ROWS})
