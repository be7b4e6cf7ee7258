"""The darkness of printed markers, relative to the film around them."""

from typing import Annotated

import cv2
import numpy as np
from annotated_types import Interval

from tactograph.sdk import F4, Close, Launch, Light, Port, node

MIN_LIGHT = np.float32(0.01)
"""Smallest light that is divided by."""

Darkness = Annotated[F4, Port("H W", "1", high=1)]
"""0 on bare film, 1 on a marker that reflects nothing."""


@node(tolerance=Close(1e-6, 1e-6, why="a division"))
def marker_darkness(
    light: Light, *, width_px: Annotated[int, Interval(ge=3, le=61)] = 11
) -> Darkness:
    """Return 1 - I / closing(I), the least over the LEDs.

    A closing with a square (the maximum within it, then the minimum of that) removes dark spots
    narrower than the square: the markers.  Light on a slope changes more slowly, and a shadow
    belongs to one LED only.

    Parameters
    ----------
    light : K x H x W, as captured or relative to the film at rest
    width_px : side of the square; a little more than a marker is wide
    """
    element = np.ones((width_px | 1, width_px | 1), np.uint8)
    closed = np.stack([cv2.morphologyEx(plane, cv2.MORPH_CLOSE, element) for plane in light])
    bright = np.max(light / np.maximum(closed, MIN_LIGHT), axis=0)
    return np.asarray(np.maximum(np.float32(1) - bright, np.float32(0)), np.float32)


@marker_darkness.opencl()
def _launch(run: Launch) -> None:
    """Highest along rows and columns, then lowest, then the ratio."""
    sizes = tuple(run.sizes[symbol] for symbol in "KHW")
    light, radius = run.inputs["light"], (int(run.settings["width_px"]) | 1) // 2
    first, second = run.scratch(sizes), run.scratch(sizes)
    run.kernel("extreme_along", sizes, light, first, *sizes, radius, 1, 1)
    run.kernel("extreme_along", sizes, first, second, *sizes, radius, 0, 1)
    run.kernel("extreme_along", sizes, second, first, *sizes, radius, 1, 0)
    run.kernel("extreme_along", sizes, first, second, *sizes, radius, 0, 0)
    out = run.outputs["marker_darkness"]
    run.kernel("darkness", sizes[1:], light, second, out, *sizes, float(MIN_LIGHT))
