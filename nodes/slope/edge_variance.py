"""Increase the variance of slopes where the camera's blur mixes two sides of an edge."""

from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge

from tactograph.graph import Close, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, Blur, Slope, SlopeVariance
from tactograph.nodes.optics.difference import difference


@node(neutral="variance", tolerance=Close(1e-5, 1e-3, why="differences of rounded normals"))
def edge_variance(
    variance: SlopeVariance, slope: Slope, blur: Blur, *, factor: Annotated[float, Ge(0)] = 6.0
) -> SlopeVariance:
    """Add the square of the difference between the slope of mixed light and the mean slope.

    A blurred pixel shows the mean normal of its surroundings, whose slope is not the mean slope.
    With n' the change of the normal per pixel, they differ to second order by at most
    s = blur^2 (1 + p^2 + q^2) sum over both axes of |n'_z| |n'| (Jensen's inequality, equation W3).
    Across an edge the expansion falls short, so (factor s)^2 is added.  The largest change within
    3 x 3 pixels counts, because an edge lies between pixels.  At such edges the rises that shadows
    measure then decide how high a rim is.

    Parameters
    ----------
    variance, slope : 2 x H x W; the slope as the camera sees it
    blur : in px
    factor : how much larger the difference is across an edge than the expansion
    """
    if blur == 0:
        return variance
    square = 1 + (slope * slope).sum(0)
    normal = np.stack([-slope[0], -slope[1], np.ones_like(square)]) / np.sqrt(square)
    along = np.zeros_like(square)
    for axis in (1, 2):
        change = _change(normal, axis)
        along += np.abs(change[2]) * np.sqrt((change * change).sum(0))
    lacking = np.float32(factor * blur * blur) * square * cv2.dilate(along, np.ones((3, 3)))
    return np.asarray(variance + lacking * lacking, np.float32)


def _change(planes: F4, axis: int) -> F4:
    """Half the difference of the neighbours along `axis`; the border repeats."""
    wide = np.pad(planes, [(int(each == axis),) * 2 for each in range(3)], mode="edge")
    return difference(wide, axis).take(range(1, wide.shape[axis] - 1), axis)


edge_variance.idle(lambda blur: blur == 0)


@edge_variance.opencl()
def _launch(run: Launch) -> None:
    """Find the change at each pixel, then the largest within 3 x 3 pixels."""
    inputs, (rows, columns) = run.inputs, (run.sizes[symbol] for symbol in "HW")
    changes, grid = run.scratch((rows, columns)), run.in_row_lanes(rows, columns)
    run.kernel("find_changes", grid, inputs["slope"], changes, rows, columns)
    by = run.settings["factor"] * float(inputs["blur"]) ** 2
    out = run.outputs["edge_variance"]
    run.kernel(
        "add_lacking", grid, inputs["variance"], inputs["slope"], changes, out, rows, columns, by
    )
