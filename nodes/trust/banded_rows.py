"""Detect light that flickers while a camera reads its rows: rows dim alike at both borders."""

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes.trust.checked_cells import DARK_LIGHT
from tactograph.nodes.trust.explained import explains
from tactograph.nodes.trust.fall_off import RING_CELLS
from tactograph.nodes.trust.light_departure import MIN_ERROR

BANDS_WARNING = (
    "whole rows are brighter or darker than their neighbours, at both borders alike: the light "
    "flickers while the camera reads its rows (expose for whole periods of the mains, keep lamps "
    "away, or drive the LEDs by steady current)"
)


def is_banded(light: F4) -> bool:
    """Return whether rows brighten and dim alike at the left and at the right border.

    Parameters
    ----------
    light : K x h x w on cells, relative to the film at rest
    """
    borders = light[..., :RING_CELLS], light[..., -RING_CELLS:]
    strips = [np.median(part, axis=2) for part in borders]
    if min(float(strip.min()) for strip in strips) < DARK_LIGHT:
        return False  # the frame is cut off
    smooth = np.vander(np.linspace(-1, 1, light.shape[1]), 3)
    left, right = (
        strip - (smooth @ np.linalg.lstsq(smooth, strip.T, rcond=None)[0]).T for strip in strips
    )
    both = float((left * right).mean())
    alone = float(np.sqrt((left**2).mean() * (right**2).mean()))
    return both > MIN_ERROR**2 and explains(alone - both**2 / alone, alone)
