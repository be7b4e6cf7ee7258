"""Fill the pixels that a mask leaves out from their surroundings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import cv2
import numpy as np
from annotated_types import Interval

from tactograph.sdk import F4, Close, Light, Mask, node

if TYPE_CHECKING:
    from tactograph.sdk import Launch

MIN_WEIGHT_SHARE = np.float32(1e-3)
"""Share of the weights that must be known."""
TILT_REGULARISATION = 0.02
"""Regularisation towards a level plane where little is known: a share of the weights' variance."""


@node(neutral="light", tolerance=Close(1e-4, 1e-4, why="sums of many terms in another order"))
def fill_masked(
    light: Light, mask: Mask, *, radius_px: Annotated[int, Interval(ge=1, le=30)] = 10
) -> Light:
    """Return the images with a plane fitted to the known surroundings where the mask is 0.

    First-order normalised convolution (Knutsson and Westin, 1993); the Gaussian's standard
    deviation is half of the radius.  Light that changes evenly continues across a hole.  The
    result is limited to the range from 0 to twice the mean around it, which a plane would leave
    at the image's border.

    Parameters
    ----------
    light : K x H x W, of full scale, or 1 on the film at rest
    mask : H x W; pixels of any value but 0 stay
    radius_px : radius of the surroundings; pixels with nothing known there stay, too
    """
    away, taps = _taps(radius_px)
    unmasked = (mask > 0).astype(np.float32)
    total = _spread(unmasked, taps, taps)
    empty = (mask == 0) & (total > MIN_WEIGHT_SHARE)
    near = np.maximum(total, MIN_WEIGHT_SHARE)

    def mean(plane: F4, in_x: F4, in_y: F4) -> F4:
        weighted = _spread(plane * unmasked, taps * in_x, taps * in_y)
        return np.asarray(weighted / near, np.float32)

    one, square = np.ones_like(away), away * away
    plain = np.ones_like(unmasked)
    x, y = mean(plain, away, one), mean(plain, one, away)
    ridge = np.float32(TILT_REGULARISATION * (radius_px / 2) ** 2)
    xx = mean(plain, square, one) - x * x + ridge
    yy = mean(plain, one, square) - y * y + ridge
    xy = mean(plain, away, away) - x * y
    inverse = np.float32(1) / (xx * yy - xy * xy)
    filled = light.copy()
    for plane, out in zip(light, filled, strict=True):
        middle = mean(plane, one, one)
        by_x, by_y = mean(plane, away, one) - middle * x, mean(plane, one, away) - middle * y
        p, q = (by_x * yy - by_y * xy) * inverse, (by_y * xx - by_x * xy) * inverse
        limit = 2 * np.fmax(middle, np.float32(0))
        out[empty] = np.fmin(np.fmax(middle - p * x - q * y, np.float32(0)), limit)[empty]
    return filled


def _taps(radius: int) -> tuple[F4, F4]:
    """Offsets along an axis, and their weights."""
    away = np.arange(-radius, radius + 1, dtype=np.float32)
    taps = np.exp(-np.square(away / np.float32(radius / 2)) / 2)
    return away, np.asarray(taps / taps.sum(), np.float32)


def _spread(plane: F4, in_x: F4, in_y: F4) -> F4:
    filtered = cv2.sepFilter2D(plane, cv2.CV_32F, in_x, in_y, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(filtered, np.float32)


@fill_masked.opencl()
def _launch(run: Launch) -> None:
    """A work-item for each pixel; only those that are masked look around."""
    radius = int(run.settings["radius_px"])
    _, weights = _taps(radius)
    taps = run.keep(weights.tobytes(), lambda: run.put(weights))
    sizes = tuple(run.sizes[symbol] for symbol in "KHW")
    planes = run.inputs["light"], run.inputs["mask"], taps, run.outputs["fill_masked"]
    ridge = TILT_REGULARISATION * (radius / 2) ** 2
    run.kernel("fill_masked", sizes, *planes, *sizes, radius, float(MIN_WEIGHT_SHARE), ridge)
