"""Compare slopes with the truth."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from tactograph.graph import node
from tactograph.nodes import Height, Metrics, PixelSize, Slope
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
    """Return the errors of slopes and normals, or nothing where no truth is known.

    Parameters
    ----------
    slope
        2 x H x W, the reconstructed slope.
    pixel
        mm per px.
    truth
        2 x H x W, the true slope; without it the true height is differentiated.
    height
        H x W in mm, the true height.
    steepest
        Pixels whose true slope is steeper (mm per mm) do not count towards the slope's
        error: across a step the difference of two heights is not a slope.

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
    measured, true = slope.astype(np.float64), truth.astype(np.float64)
    gentle = (true**2).sum(axis=0) <= steepest**2
    metrics = {"normal_error_deg": float(np.degrees(_angle(measured, true)).mean())}
    if gentle.any():
        metrics["slope_rmse"] = float(np.sqrt(((measured - true)[:, gentle] ** 2).mean()))
    return metrics


def _angle(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle between the normals (-p, -q, 1), in radians.

    The cross product is used, too: the arc cosine alone loses all digits at small angles.
    """
    p, q = a - b
    twist = a[0] * b[1] - a[1] * b[0]
    return np.arctan2(np.sqrt(p * p + q * q + twist * twist), 1 + (a * b).sum(axis=0))
