"""Check whether the slopes of a touch are those of one surface."""

from __future__ import annotations

from tactograph.nodes import F4
from tactograph.nodes.trust._check import Check, spread_of

MAX_MEDIAN, MAX_QUARTILE = 0.77, 3.5
"""Curl over its expected size that right touches stay below."""


def check_curl(curl: F4) -> Check:
    """Return the departure of slopes from the gradient of a height (`slope_curl`, T2, h x w)."""
    middle, upper = spread_of(curl[curl >= 0])
    return Check(
        max(middle / MAX_MEDIAN, upper / MAX_QUARTILE),
        "the slopes are those of no surface (check the order of the images, that none is mirrored "
        "or turned, that all are of one touch, and that nothing moved while the LEDs flashed)",
    )
