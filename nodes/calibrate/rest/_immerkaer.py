"""Noise by a mask that is blind to smooth light.

J. Immerkaer, "Fast noise variance estimation", 1996.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4

MASK_TAPS = np.array([1, -2, 1], np.float32)
"""Taps along x and along y, blind to planes and twists; the response to white noise of 1 is 6."""
USED_SHARE, USED_MEAN = 0.8, 0.5586
"""Share of responses that are not edges, and their mean magnitude for a normal distribution."""


def responses(plane: F4, apart: int = 1) -> F4:
    """The magnitude of the mask's response to an image (H x W), with taps `apart` pixels apart."""
    taps = np.zeros(2 * apart + 1, np.float32)
    taps[::apart] = MASK_TAPS
    return np.abs(cv2.sepFilter2D(plane, -1, taps, taps, borderType=cv2.BORDER_REPLICATE))


def variances(residual: F4) -> NDArray[Any]:
    """The variance of a pixel from the smaller responses along the last axis (... x N)."""
    calm = np.sort(residual)[..., : max(1, int(USED_SHARE * residual.shape[-1]))]
    return np.asarray(np.square(calm.mean(axis=-1, dtype=np.float64) / (USED_MEAN * 6)))
