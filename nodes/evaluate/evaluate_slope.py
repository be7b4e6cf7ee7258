"""Compare slopes with the truth."""

from typing import Annotated

import numpy as np
from annotated_types import Gt

from tactograph.graph import node
from tactograph.nodes import Height, Metrics, PixelSize, Slope
from tactograph.nodes.optics.normals import angle_between
from tactograph.nodes.slope.height_slopes import height_slopes


@node
def evaluate_slope(
    slope: Slope,
    pixel: PixelSize,
    truth: Slope | None = None,
    height: Height | None = None,
    *,
    steepest: Annotated[float, Gt(0)] = 4.0,
) -> Metrics:
    """Return the errors of slopes and normals, or nothing without truth.

    Parameters
    ----------
    slope : 2 x H x W, the reconstructed slope
    pixel : mm per px
    truth : 2 x H x W, the true slope; None: the true height is differentiated
    height : H x W in mm, the true height
    steepest
        Pixels whose true slope is steeper (mm per mm) do not count towards the slope's
        error: a difference across a step is no slope.

    Returns
    -------
    dict
        ``slope_rmse``, over both components of the pixels that count; ``normal_error_deg``,
        the mean angle between reconstructed and true normal over the whole frame.
    """
    if truth is None:
        if height is None:
            return {}
        truth = height_slopes(height, pixel).slope
    gentle = truth[0] ** 2 + truth[1] ** 2 <= np.float32(steepest) ** 2
    angle = angle_between(slope, truth)
    metrics = {"normal_error_deg": float(np.degrees(angle.mean(dtype=np.float64)))}
    if counted := 2 * np.count_nonzero(gentle):
        # Zeros instead of a selection: gathering planes by a mask takes ten times as long.
        missed = (slope - truth) * gentle
        metrics["slope_rmse"] = float(np.square(missed).sum(dtype=np.float64) / counted) ** 0.5
    return metrics
