"""Check whether the slopes of a touch are those of one surface."""

from tactograph.nodes.trust._check import Check, worst
from tactograph.nodes.trust._curl_evidence import CurlFigures

MAX_MEDIAN, MAX_QUARTILE = 0.92, 4.2
"""Curl over its expected size that right touches stay below."""
MAX_PART_SHARE = 0.4
"""Share of the cells of a part that curl, which right touches stay below."""

SLOPES_OF_NO_SURFACE = (
    "the slopes are those of no surface (check the order of the images, that none is mirrored or "
    "turned, that all are of one touch, and that nothing moved while the LEDs flashed)"
)
PART_OF_NO_SURFACE = (
    "in a part of the image the slopes are those of no surface (check that the frames are whole, "
    "and that nothing moved while the LEDs flashed)"
)


def check_curl(curl: CurlFigures) -> Check:
    """Return the departure of slopes from the gradient of a height (T2)."""
    middle, upper, part = curl
    whole = max(middle / MAX_MEDIAN, upper / MAX_QUARTILE)
    if whole > 1:
        return Check(whole, SLOPES_OF_NO_SURFACE)
    return worst({SLOPES_OF_NO_SURFACE: whole, PART_OF_NO_SURFACE: part / MAX_PART_SHARE})
