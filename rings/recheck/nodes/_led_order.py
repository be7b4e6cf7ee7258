"""The order of images, checked by the light of each LED on the untouched film."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from tactograph.sdk import F4, F8, FilmEvidence

MIN_CORRELATION = 0.9
"""Correlation above which two images show the light of one LED.  A new film leaves 0.99."""
MIN_CORRELATION_GAIN = 0.2
"""Smallest gain of each image's correlation if it is taken for another LED's."""


def other_order(then: F4, now: F4, pixel: float) -> list[int] | None:
    """Return the LED, counted from 1, whose light each image has now; None if its own.

    How the light falls off over the film tells the LEDs apart: strength, albedo and vignetting
    drop out.  Of all orders the one is taken in which the images correlate best with those of
    before.

    Parameters
    ----------
    then, now : K x H x W, the untouched film
    pixel : mm per px
    """
    before, after = (FilmEvidence.of_flat(film, pixel).rest() for film in (then, now))
    if before is None or after is None:
        return None
    alike = _shape(after.logarithm) @ _shape(before.logarithm).T
    image, led = linear_sum_assignment(-alike)
    other = image != led
    matched, unmatched = alike[image, led][other], alike[image, image][other]
    if (
        not other.any()
        or matched.min() < MIN_CORRELATION
        or (matched - unmatched).min() < MIN_CORRELATION_GAIN
    ):
        return None
    return [int(k) + 1 for k in led]


def _shape(logarithm: F8) -> F8:
    """Each LED's fall-off, of mean 0 and length 1."""
    centred = logarithm - logarithm.mean(axis=1, keepdims=True)
    length = np.linalg.norm(centred, axis=1, keepdims=True)
    return np.asarray(centred / np.maximum(length, 1e-12))
