"""Measure the camera's noise on any capture of something smooth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve
from scipy.optimize import nnls

from tactograph.graph import node
from tactograph.nodes import F4, Light, Noise

MASK = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
"""Blind to planes and to twists; its response to white noise of 1 is 6."""
KEPT, KEPT_MEAN = 0.8, 0.5586
"""The share of responses that are not edges, and their mean magnitude under a normal law."""
LEVELS = np.linspace(0.04, 0.96, 24)
"""Light at which noise is looked at: not black and not saturated."""
FEWEST = 400
LEAST = 1e-8
"""Variance that remains however clean the images: a tenth of a 12-bit step, squared."""


@node
def estimate_noise(image: Light) -> Noise:
    """Return (shot, read): the variance of a captured light I is shot I + read.

    Immerkaer's fast noise variance estimation (1996), for each level of light apart: the
    mean magnitude of what a mask leaves that is blind to smooth light, edges cut off.
    Non-negative least squares over the levels separates shot from read noise.

    Parameters
    ----------
    image
        K x H x W, as captured.

    Returns
    -------
    ndarray
        Length 2.
    """
    left = np.stack([np.abs(convolve(plane, MASK, mode="nearest")) for plane in image])
    number = np.digitize(image, LEVELS)
    rows, variances, weights = [], [], []
    for level in range(1, len(LEVELS)):
        chosen = number == level
        count = int(chosen.sum())
        if count >= FEWEST:
            rows.append([image[chosen].mean(), 1.0])
            variances.append(_variance(left[chosen]))
            weights.append(np.sqrt(count) / max(variances[-1], LEAST))
    if not rows:
        return np.array([0, max(_variance(left.ravel()), LEAST)], np.float32)
    scale = np.array(weights) / max(weights)
    found, _ = nnls(np.array(rows) * scale[:, None], np.array(variances) * scale)
    return np.array([found[0], max(found[1], LEAST)], np.float32)


def _variance(left: F4) -> float:
    """Variance of a pixel from the smaller of the mask's responses."""
    calm: NDArray[np.floating] = np.sort(left)[: max(1, int(KEPT * left.size))]
    return float(calm.mean(dtype=np.float64) / (KEPT_MEAN * 6)) ** 2
