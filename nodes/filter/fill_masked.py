"""Fill what a mask leaves out from what lies around."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import cv2
import numpy as np
from annotated_types import Interval

from tactograph.graph import Close, node
from tactograph.nodes import F4, Light, Mask

if TYPE_CHECKING:
    from tactograph.graph.backends.launch import Launch

LEAST = np.float32(1e-3)
"""Share of the weights that has to be known."""


@node(neutral="light", tolerance=Close(1e-5, 1e-5, why="sums of many terms in another order"))
def fill_masked(
    light: Light, mask: Mask, *, radius_px: Annotated[int, Interval(ge=1, le=30)] = 10
) -> Light:
    """Return the images, where the mask is 0 with the Gaussian mean of what is known around.

    Normalised convolution (Knutsson and Westin, 1993), its standard deviation half of the radius.

    Parameters
    ----------
    light
        K x H x W.
    mask
        H x W; pixels of any value but 0 stay.
    radius_px
        How far around; pixels that see nothing known stay, too.
    """
    taps = _taps(radius_px)
    known = (mask > 0).astype(np.float32)
    total = _spread(known, taps)
    filled = light.copy()
    empty = (mask == 0) & (total > LEAST)
    for plane, out in zip(light, filled, strict=True):
        out[empty] = _spread(plane * known, taps)[empty] / total[empty]
    return filled


def _taps(radius: int) -> F4:
    away = np.arange(-radius, radius + 1) / (radius / 2)
    taps = np.exp(-away * away / 2)
    return np.asarray(taps / taps.sum(), np.float32)


def _spread(plane: F4, taps: F4) -> F4:
    found = cv2.sepFilter2D(plane, cv2.CV_32F, taps, taps, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(found, np.float32)


@fill_masked.opencl()
def _launch(run: Launch) -> None:
    """A work-item for each pixel; only those that are masked look around."""
    radius = int(run.settings["radius_px"])
    weights = _taps(radius)
    taps = run.keep(weights.tobytes(), lambda: run.upload(weights))
    sizes = tuple(run.sizes[symbol] for symbol in "KHW")
    planes = run.inputs["light"], run.inputs["mask"], taps, run.outputs["fill_masked"]
    run.kernel("fill_masked", sizes, *planes, *sizes, radius, float(LEAST))
