"""Take some noise out of the light before it becomes slope."""

import numpy as np

from tactograph.sdk import F4, Close, Launch, Light, node

BINOMIAL_WEIGHTS = (0.0625, 0.25, 0.375, 0.25, 0.0625)
"""Binomial: close to a Gaussian of one pixel's standard deviation."""
SMOOTHED_PX = 1.0
"""Their standard deviation."""
ITEM_ROWS = 4
"""Rows per work-item of the kernel."""


@node(neutral="light", tolerance=Close(1e-6, 1e-6, why="a sum of 25 terms"))
def smooth_light(light: Light) -> Light:
    """Return the light averaged over 5 x 5 pixels with binomial weights (1 4 6 4 1) / 16.

    A sensor with three lights has no redundancy to check a slope against, and at 8 bits its
    noise amounts to a degree of slope.  Beyond the frame the border repeats.

    Parameters
    ----------
    light : K x H x W
    """
    return _along(_along(light, 2), 1)


def _along(light: F4, axis: int) -> F4:
    """Average along one axis."""
    last = light.shape[axis] - 1
    at = np.arange(light.shape[axis])
    total = np.zeros_like(light)
    for shift, tap in enumerate(BINOMIAL_WEIGHTS, -2):
        total = total + np.float32(tap) * np.take(light, np.clip(at + shift, 0, last), axis)
    return np.asarray(total, np.float32)


@smooth_light.opencl()
def _launch(run: Launch) -> None:
    """Each work-item computes `ITEM_ROWS` rows."""
    count, rows, columns = (run.sizes[name] for name in "KHW")
    arguments = run.inputs["light"], run.outputs["smooth_light"], count, rows, columns
    grid = run.in_row_lanes(count, -(-rows // ITEM_ROWS), columns)
    run.kernel("smooth_light", grid, *arguments, constants={"ITEM_ROWS": ITEM_ROWS})
