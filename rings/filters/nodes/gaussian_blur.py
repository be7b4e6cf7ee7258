"""Blur images by a Gaussian."""

from typing import Annotated

import cv2
import numpy as np
from annotated_types import Interval

from tactograph.rings.filters.nodes._border import BORDER_TYPES, Border
from tactograph.sdk import F4, Close, Launch, Light, node

CUTOFF_SIGMAS = 4
"""Standard deviations after which the Gaussian is cut off, as in OpenCV for floats."""


@node(neutral="light", tolerance=Close(1e-6, 1e-5, why="sums in another order"))
def gaussian_blur(
    light: Light,
    *,
    sigma: Annotated[float, Interval(gt=0, le=20)] = 1.0,
    border: Border = "replicate",
) -> Light:
    """Return the images blurred by a Gaussian, each LED separately.

    OpenCV's `GaussianBlur`; the Gaussian is cut off after four standard deviations.

    Parameters
    ----------
    light : K x H x W
    sigma : standard deviation in pixels
    border
        Pixels beyond the frame, as OpenCV's `borderType`: ``replicate`` (aaa|abcd|ddd),
        ``reflect`` (cba|abcd|dcb) or ``reflect_101`` (dcb|abcd|cba).
    """
    side = len(_taps(sigma))
    rule = BORDER_TYPES[border]
    blurred = [cv2.GaussianBlur(plane, (side, side), sigma, borderType=rule) for plane in light]
    return np.asarray(blurred, np.float32)


def _taps(sigma: float) -> F4:
    """The Gaussian's weights, an odd number of them; they sum to 1."""
    side = 2 * int(np.ceil(CUTOFF_SIGMAS * sigma)) + 1
    return np.asarray(cv2.getGaussianKernel(side, sigma, cv2.CV_32F), np.float32).ravel()


@gaussian_blur.opencl()
def _launch(run: Launch) -> None:
    """Blur along rows, then along columns."""
    light, out = run.inputs["light"], run.outputs["gaussian_blur"]
    sigma, border = float(run.settings["sigma"]), run.settings["border"]
    taps = run.put(_taps(sigma))
    rule = list(BORDER_TYPES).index(border)
    sizes = run.sizes["K"], run.sizes["H"], run.sizes["W"]
    along, grid = run.scratch(sizes), run.in_row_lanes(*sizes)
    radius = taps.shape[0] // 2
    run.kernel("blur_rows", grid, light, taps, along, *sizes, radius, rule)
    run.kernel("blur_columns", grid, along, taps, out, *sizes, radius, rule)
