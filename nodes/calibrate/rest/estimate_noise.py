"""Measure the camera's noise on any capture of a smooth scene."""

import numpy as np
from scipy.optimize import nnls

from tactograph.graph import node
from tactograph.nodes import Light, Noise
from tactograph.nodes.calibrate.rest._immerkaer import responses, variances

LIGHT_LEVELS = np.linspace(0.04, 0.96, 24)
"""Levels of light between which noise is measured: neither black nor saturated."""
MIN_RESPONSES = 400
MIN_READ_VARIANCE = 1e-8
"""Smallest read variance, however clean the images are."""


@node
def estimate_noise(image: Light) -> Noise:
    """Return (shot, read): the variance of a captured light I is shot I + read.

    Immerkaer's fast noise variance estimation (1996), separately for each level of light: the
    mean magnitude of the response of a mask that is blind to smooth light, without edges.
    Non-negative least squares over the levels separates shot noise from read noise.

    Parameters
    ----------
    image : K x H x W, as captured
    """
    residual = np.stack([responses(plane) for plane in image])
    number = np.stack([np.digitize(plane, LIGHT_LEVELS).astype(np.uint8) for plane in image])
    rows, squares, weights = [], [], []
    for level in range(1, len(LIGHT_LEVELS)):
        chosen = number == level
        count = int(chosen.sum())
        if count >= MIN_RESPONSES:
            rows.append([image[chosen].mean(), 1.0])
            squares.append(float(variances(residual[chosen])))
            weights.append(np.sqrt(count) / max(squares[-1], MIN_READ_VARIANCE))
    if not rows:
        return np.array([0, max(float(variances(residual.ravel())), MIN_READ_VARIANCE)], np.float32)
    scale = np.array(weights) / max(weights)
    noise, _ = nnls(np.array(rows) * scale[:, None], np.array(squares) * scale)
    return np.array([noise[0], max(noise[1], MIN_READ_VARIANCE)], np.float32)
