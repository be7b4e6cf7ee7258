"""Check whether the slopes of a touch are those of one surface."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4
from tactograph.nodes.trust._check import MIN_CELLS, Check, spread_of

MAX_MEDIAN, MAX_QUARTILE = 0.92, 4.2
"""Curl over its expected size that right touches stay below."""

PARTS_PER_SIDE = 3
"""Parts of the image along a side, each of which is looked at wherever it lies."""
MAX_PART_CURL, MAX_PART_SHARE = 3.0, 0.4
"""Curl over its expected size, and the share of the cells of a part that right touches have above
it at most."""
MIN_TESTED_SHARE = 0.25
"""Share of a part's cells that are taken to be tested at least: of few cells many may curl by
chance."""


def check_curl(curl: F4) -> Check:
    """Return the departure of slopes from the gradient of a height (`slope_curl`, T2, h x w)."""
    middle, upper = spread_of(curl[curl >= 0])
    whole = Check(
        max(middle / MAX_MEDIAN, upper / MAX_QUARTILE),
        "the slopes are those of no surface (check the order of the images, that none is mirrored "
        "or turned, that all are of one touch, and that nothing moved while the LEDs flashed)",
    )
    if whole.figure > 1:
        return whole
    part = Check(
        _worst_part(curl) / MAX_PART_SHARE,
        "in a part of the image the slopes are those of no surface (check that the frames are "
        "whole, and that nothing moved while the LEDs flashed)",
    )
    return max(whole, part, key=lambda check: check.figure)


def _worst_part(curl: F4) -> float:
    """The largest share of cells that curl in a part of the image."""
    part = tuple(max(1, side // PARTS_PER_SIDE) for side in curl.shape[::-1])

    def count(cells: NDArray[np.bool_]) -> NDArray[Any]:
        plane = cells.astype(np.float32)
        return cv2.boxFilter(plane, -1, part, normalize=False, borderType=cv2.BORDER_CONSTANT)

    tested = count(curl >= 0)
    least = max(MIN_CELLS, MIN_TESTED_SHARE * part[0] * part[1])
    share = count(curl > MAX_PART_CURL**2) / np.maximum(tested, least)
    return float(share[tested >= MIN_CELLS].max(initial=0))
