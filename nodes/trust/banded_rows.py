"""Light that flickers while a camera reads its rows: whole rows dim, at both borders alike."""

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes.trust.added_light import DARK_LIGHT

STRIP_SHARE = 0.125
"""Share of the columns at either border on which bands are looked for."""
MIN_BAND, MIN_LIKENESS = 0.01, 0.9
"""Standard deviation of the light of rows, and its correlation between both borders, of bands.
Local contrast dims rows less alike, with 0.87 of correlation at most."""
BANDS_TOLD = (
    "whole rows are brighter or darker than those beside them, at both borders alike: the light "
    "flickers while the camera reads its rows (expose for whole periods of the mains, keep lamps "
    "away, or drive the LEDs by steady current)"
)


def is_banded(light: F4) -> bool:
    """Return whether rows at the left and at the right border are brighter and darker alike.

    Parameters
    ----------
    light : K x H x W, relative to the film at rest
    """
    rows, width = light.shape[1], max(2, round(STRIP_SHARE * light.shape[2]))
    strips = [np.median(part, axis=2) for part in (light[..., :width], light[..., -width:])]
    if min(float(strip.min()) for strip in strips) < DARK_LIGHT:
        return False  # a frame that is cut off
    smooth = np.vander(np.linspace(-1, 1, rows), 3)
    left, right = (
        strip - (smooth @ np.linalg.lstsq(smooth, strip.T, rcond=None)[0]).T for strip in strips
    )
    both = float((left * right).mean())
    alone = float(np.sqrt((left**2).mean() * (right**2).mean()))
    return both > MIN_BAND**2 and both > MIN_LIKENESS * alone
