"""Compare a height with the truth, as the paper's Table 1 does."""

import numpy as np

from tactograph.graph import node
from tactograph.nodes import UM_PER_MM, Height, Metrics, PixelSize


@node
def evaluate_height(height: Height, pixel: PixelSize, truth: Height | None = None) -> Metrics:
    """Return the errors of a height, or nothing without truth.

    Neither height is shifted or scaled to fit; zero is the film at rest.  The object is the area
    where the truth is above zero.

    Parameters
    ----------
    height, truth : H x W in mm
    pixel : mm per px; the paper states errors in pixels

    Returns
    -------
    dict
        ``max_error_px`` over the whole frame and ``over_10_percent``, the number of pixels
        whose error exceeds a tenth of the object's height, in per cent of the object's area,
        which are the two of the paper's Table 1; ``rmse_px``; ``max_error_um`` and ``rmse_um``
        in micrometres; ``peak_error_percent``; ``peak_px``, the true height.
    """
    if truth is None:
        return {}
    error = np.abs(height - truth)
    largest, rmse = float(error.max()), float(np.square(error).mean(dtype=np.float64)) ** 0.5
    top = np.unravel_index(int(truth.argmax()), truth.shape)
    peak = float(truth[top])
    area = max(int(np.count_nonzero(truth > 0)), 1)
    wrong = np.count_nonzero(error > np.float32(0.1 * peak))
    return {
        "max_error_px": largest / pixel,
        "over_10_percent": float(100 * wrong / area) if peak > 0 else 0.0,
        "rmse_px": rmse / pixel,
        "max_error_um": UM_PER_MM * largest,
        "rmse_um": UM_PER_MM * rmse,
        "peak_error_percent": 100 * (float(height[top]) / peak - 1) if peak > 0 else 0.0,
        "peak_px": peak / pixel,
    }
