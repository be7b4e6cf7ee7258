"""The errors of the steps from pixel to pixel, and of edges that no pixel resolves.

``kernels/error/height_error.cl`` holds the same (err_steps, err_kinks, deviation).
"""

import math

import cv2
import numpy as np

from tactograph.nodes import F4, Height
from tactograph.nodes.error._random_errors import Keys, drawn

MAX_BEND = np.float32(2)
"""A sharper turn counts as this sharp: its step has little weight."""
RESOLVED_BEND = np.float32(0.5)
"""Difference of slopes from pixel to pixel up to which an edge is resolved.  What a sharper kink
lacks shows where shadows measure its rise (`RISE_SHARE`), and differs in sign elsewhere."""
PLACE_VARIANCE_PX2 = 1 / 12
"""Of an edge that may lie anywhere in a pixel, in px^2."""
SHARED_RISE_ERROR = 0.2
"""Error in px, per px of blur, that the rises of all shadows share."""

Steps = tuple[F4, F4]
"""Steps to the right and down in mm, h x w-1 and h-1 x w."""


def turns(steps: Steps) -> Steps:
    """Return the differences of steps from their neighbours."""
    right, down = steps
    return _turn(right, axis=1), _turn(down, axis=0)


def _turn(step: F4, axis: int) -> F4:
    if step.shape[axis] < 2:
        return np.zeros_like(step)
    return np.abs(np.gradient(step, axis=axis))


def random_steps(slopes: F4, turn: Steps, keys: Keys, pixel: float, aperture: float) -> Steps:
    """Return an error of steps: that of the slopes at their ends, and of their computation.

    The latter is random, `aperture` times as large as steps differ, which counts up to `MAX_BEND`.
    """
    p, q = slopes
    size, times = 0.5 * np.float32(pixel), np.float32(aperture)
    right, down = (times * np.minimum(each, MAX_BEND * np.float32(pixel)) for each in turn)
    return (
        (p[:, 1:] + p[:, :-1]) * size + right * drawn(keys.right, p.shape)[:, :-1],
        (q[1:] + q[:-1]) * size + down * drawn(keys.down, p.shape)[:-1],
    )


def kinks(steps: Steps, turn: Steps, kink: float, pixel: float) -> Steps:
    """Return the lack of steps where slopes change within a pixel: all are too small, uphill."""
    right, down = (np.minimum(each / np.float32(pixel), RESOLVED_BEND) ** 3 for each in turn)
    lack = np.float32(kink * pixel)
    return lack * right * np.sign(steps[0]), lack * down * np.sign(steps[1])


def common_rise(blur: float | None, pixel: float) -> np.float32:
    """Return the error in mm that the rises of all shadows share."""
    return np.float32((blur or 0.0) * SHARED_RISE_ERROR * pixel)


def edge_deviation_px(blur: float) -> np.float32:
    """Return the standard deviation in px of the place of an edge that a pixel does not resolve.

    It may lie anywhere in the pixel, and as far away as the blur spreads it.
    """
    return np.float32(math.sqrt(PLACE_VARIANCE_PX2 + blur * blur))


def flattening_px2(blur: float) -> np.float32:
    """Return by how much a blur lowers a height, per second difference of it.

    A Gaussian that spreads the light spreads the slopes and the height that follows from them, to
    first order by half its variance times the Laplacian.
    """
    return np.float32(blur * blur / 2)


def blurred(height: Height, pixel: float, blur: float = 0.0) -> F4:
    """Return the deviation of heights by a pixel's size and the camera's blur, in mm.

    An edge that no pixel resolves is out of place (`edge_deviation_px`), and what bends more gently
    is flattened (`flattening_px2`).
    """
    across, along = _bends(height)
    beyond = largest_bend(height) - RESOLVED_BEND * np.float32(pixel)
    edge = np.maximum(beyond, np.float32(0)) * edge_deviation_px(blur)
    flat = np.abs(flattening_px2(blur) * (across + along))
    return np.asarray(np.maximum(edge, flat), np.float32)


def largest_bend(height: Height) -> F4:
    """Return the largest root of squares of the height's second differences, of 3 x 3 pixels."""
    return np.asarray(cv2.dilate(np.hypot(*_bends(height)), np.ones((3, 3), np.uint8)))


def _bends(height: Height) -> tuple[F4, F4]:
    """The second differences across and along; the border repeats."""
    around = np.pad(height, 1, mode="edge")
    across = around[1:-1, 2:] - 2 * height + around[1:-1, :-2]
    return across, around[2:, 1:-1] - 2 * height + around[:-2, 1:-1]
