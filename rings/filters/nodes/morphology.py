"""Erode, dilate, open or close a mask."""

from typing import Annotated, Literal

import cv2
import numpy as np
from annotated_types import Interval

from tactograph.sdk import U1, Launch, Mask, node

Operation = Literal["erode", "dilate", "open", "close"]
Shape = Literal["rect", "cross", "ellipse"]
OPENCV_OPERATIONS: dict[Operation, int] = {
    "erode": cv2.MORPH_ERODE,
    "dilate": cv2.MORPH_DILATE,
    "open": cv2.MORPH_OPEN,
    "close": cv2.MORPH_CLOSE,
}
KERNEL_PASSES: dict[Operation, tuple[int, ...]] = {
    "erode": (0,),
    "dilate": (1,),
    "open": (0, 1),
    "close": (1, 0),
}
"""The kernel's passes, in order: 0 takes the lowest value, 1 the highest."""
OPENCV_SHAPES: dict[Shape, int] = {
    "rect": cv2.MORPH_RECT,
    "cross": cv2.MORPH_CROSS,
    "ellipse": cv2.MORPH_ELLIPSE,
}


@node(neutral="mask")
def morphology(
    mask: Mask,
    *,
    operation: Operation = "open",
    radius: Annotated[int, Interval(ge=1, le=15)] = 1,
    shape: Shape = "ellipse",
) -> Mask:
    """Return the mask eroded, dilated, opened or closed.

    OpenCV's `morphologyEx`, one iteration.  Pixels beyond the frame do not count: they neither
    erode nor dilate (``morphologyDefaultBorderValue``).

    Parameters
    ----------
    mask : H x W
    operation
        ``erode`` removes the rim; ``dilate`` adds one; ``open`` (erode, then dilate) removes
        what is smaller than the element; ``close`` (dilate, then erode) fills such holes.
    radius : the structuring element measures 2 * radius + 1 pixels each way
    shape : shape of the structuring element, as `getStructuringElement` draws it
    """
    changed = cv2.morphologyEx(mask, OPENCV_OPERATIONS[operation], _element(shape, radius))
    return np.asarray(changed, np.uint8)


def _element(shape: Shape, radius: int) -> U1:
    """The structuring element: 1 where a pixel counts."""
    side = 2 * radius + 1
    return np.asarray(cv2.getStructuringElement(OPENCV_SHAPES[shape], (side, side)), np.uint8)


@morphology.opencl()
def _launch(run: Launch) -> None:
    """One pass of lowest or highest values, or two."""
    radius = int(run.settings["radius"])
    element = run.put(_element(run.settings["shape"], radius))
    grid = run.sizes["H"], run.sizes["W"]
    passes = KERNEL_PASSES[run.settings["operation"]]
    there, out = run.inputs["mask"], run.outputs["morphology"]
    for number, highest in enumerate(passes, start=1):
        target = out if number == len(passes) else run.scratch(grid, np.uint8)
        run.kernel("extreme", grid, there, element, target, *grid, radius, highest)
        there = target
