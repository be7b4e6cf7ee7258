"""Differentiate a known height."""

from typing import Annotated

import numpy as np
from annotated_types import Gt

from tactograph.graph import Close, node
from tactograph.nodes import Height, KnownSlopes, PixelSize
from tactograph.nodes.optics.difference import difference


@node(tolerance=Close(1e-5, 1e-5, why="division by the pixel size"))
def height_slopes(
    height: Height, pixel: PixelSize, *, steepest: Annotated[float, Gt(0)] = 4.0
) -> KnownSlopes:
    """Differentiate a height map (paper 3.1: "a calibration object with known shape").

    Central differences, one-sided at the border.

    Parameters
    ----------
    height : H x W in mm above the film at rest
    pixel : mm per px
    steepest
        Pixels steeper than this (mm per mm) are masked out: a difference across a step is no
        slope.

    Returns
    -------
    Slope 2 x H x W and the mask of pixels where it can be trusted.
    """
    p = difference(height, 1) / np.float32(pixel)
    q = difference(height, 0) / np.float32(pixel)
    mask = p * p + q * q <= np.float32(steepest) * np.float32(steepest)
    return KnownSlopes(np.stack([p, q]), mask.astype(np.uint8))


height_slopes.opencl(grid="H W", lanes="rows")
