"""Resize images."""

from functools import lru_cache
from typing import Annotated, Literal

import cv2
import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.sdk import F4, Close, Launch, Light, SizeRule, node
from tactograph.sdk.unstable import ResizedLight

Method = Literal["area", "linear"]
OPENCV_METHODS: dict[Method, int] = {"area": cv2.INTER_AREA, "linear": cv2.INTER_LINEAR}
MIN_PIXEL_PART = 1e-3
"""A smaller part of a pixel is left out of an area, as in OpenCV."""


def _side(pixels: int, scale: float) -> int:
    return max(1, round(pixels * scale))


@node(
    derived={
        "h": SizeRule("H", by="scale", rule=_side),
        "w": SizeRule("W", by="scale", rule=_side),
    },
    tolerance=Close(1e-6, 1e-5, why="sums in another order"),
)
def resize_image(
    light: Light,
    *,
    scale: Annotated[float, Interval(ge=0.05, le=8)] = 0.5,
    method: Method = "area",
) -> ResizedLight:
    """Return the images with another number of pixels.

    OpenCV's `resize`.  Both sides scale alike, so that pixels stay square, apart from rounding
    to whole pixels: the sides of a pixel become W / w and H / h times as long.  A calibration
    is valid for images of its size: resize its images alike.

    Parameters
    ----------
    light : K x H x W
    scale : pixels along a side of the result per pixel of the input
    method
        ``area``: the mean over the area of a pixel, which keeps the noise's share and makes no
        patterns; ``linear``: from the four pixels around its centre, smooth where an image is
        enlarged.

    Returns
    -------
    K x h x w, with h = scale H and w = scale W, rounded.
    """
    _count, rows, columns = light.shape
    size = _side(columns, scale), _side(rows, scale)
    planes = [cv2.resize(plane, size, interpolation=OPENCV_METHODS[method]) for plane in light]
    return np.asarray(planes, np.float32)


@lru_cache(maxsize=16)
def _taps(before: int, after: int, method: Method) -> tuple[NDArray[np.int32], F4]:
    """First pixel read, and shares, for each pixel of the result along one side."""
    find = _area if method == "area" else _linear
    parts = [find(at, before / after, before) for at in range(after)]
    count = max(len(shares) for _, shares in parts)
    first = np.array([min(start, before - count) for start, _ in parts], np.int32)
    table = np.zeros((after, count), np.float32)
    for row, (start, shares), moved in zip(table, parts, first, strict=True):
        row[start - moved :][: len(shares)] = shares
    return first, table


def _area(at: int, ratio: float, before: int) -> tuple[int, list[float]]:
    """The first pixel under result pixel `at`, which is `ratio` pixels wide, and the shares."""
    start = at * ratio
    left = int(start)
    if ratio < 1:
        beyond = (at + 1) - (left + 1) / ratio
        share = beyond - np.floor(beyond) if beyond > 0 and left < before - 1 else 0.0
        return left, [1 - share, share] if share else [1.0]
    end = min(start + ratio, before)
    width = end - start
    left, right = int(np.ceil(start)), min(int(end), before - 1)
    shares = [1 / width] * (right - left)
    if end - right > MIN_PIXEL_PART:
        shares.append(min(end - right, 1) / width)
    if left - start > MIN_PIXEL_PART:
        return left - 1, [(left - start) / width, *shares]
    return left, shares


def _linear(at: int, ratio: float, before: int) -> tuple[int, list[float]]:
    """The same for the pixels on both sides of the centre of result pixel `at`."""
    centre = (at + 0.5) * ratio - 0.5
    left = int(np.floor(centre))
    if left < 0 or left >= before - 1:
        return min(max(left, 0), before - 1), [1.0]
    return left, [1 - (centre - left), centre - left]


@resize_image.opencl()
def _launch(run: Launch) -> None:
    """Find on the host the pixels that each row and column reads; sum them on the device."""
    method = run.settings["method"]
    first_row, of_row = _taps(run.sizes["H"], run.sizes["h"], method)
    first_column, of_column = _taps(run.sizes["W"], run.sizes["w"], method)
    tables = [run.put(table) for table in (first_row, of_row, first_column, of_column)]
    grid = run.sizes["K"], run.sizes["h"], run.sizes["w"]
    sizes = run.sizes["K"], run.sizes["H"], run.sizes["W"], *grid[1:]
    counts = of_row.shape[1], of_column.shape[1]
    out = run.outputs["resize_image"]
    run.kernel("resize", grid, run.inputs["light"], *tables, out, *sizes, *counts)
