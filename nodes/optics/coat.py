"""A rough dielectric coat: what its microfacets mirror, hide and let through (equation F3).

Beckmann's distribution; Walter et al., Microfacet models for refraction (2007).  All functions
take cosines of any shape.  ``kernels/headers/coat.clh`` holds the same.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

TAIL = 0.4361836, -0.1201676, 0.9372980
"""The tail of the normal distribution in powers of 1 / (1 + 0.33267 z) (Abramowitz and Stegun,
26.2.16)."""

ROOT_3 = 3**0.5


def fresnel(cosine: Array, index: float) -> Array:
    """Return the share of unpolarised light that a dielectric mirrors."""
    g = np.sqrt(index * index - 1 + cosine * cosine)
    first, second = (g - cosine) / (g + cosine), cosine * (g + cosine) - 1
    other = second / (cosine * (g - cosine) + 1)
    return np.asarray(0.5 * first * first * (1 + other * other))


def let_in(cosine: Array, roughness: float, index: float) -> Array:
    """Return the share T of light that a rough coat lets through to its base, and out again.

    1 - F, averaged over the microfacets by their projected area towards the light.  Their slope x
    towards the light is normally distributed with standard deviation t = roughness / sqrt(2).
    Light at the cosine c (sine s) sees c + s x of each facet that faces it.  The average is a sum
    over three nodes with the facets' mean, standard deviation and skewness (Gauss's for a gamma
    distribution, to first order in the skewness).  For a roughness of 0.4 it is right to 0.003
    from a cosine of 0.2 on and to 0.006 below it; for a roughness of 0.2, to 0.001 and 0.002.
    """
    t = roughness / np.sqrt(2).astype(cosine.dtype)
    sine = np.sqrt(np.maximum(1 - cosine * cosine, 0))
    spread = np.maximum(t * sine, 1e-6)
    z = cosine / spread
    density = np.exp(-0.5 * z * z) * (1 / np.sqrt(2 * np.pi)).astype(cosine.dtype)
    w = 1 / (1 + 0.33267 * z)
    facing = 1 - density * w * (TAIL[0] + w * (TAIL[1] + w * TAIL[2]))
    open_, grazed = cosine * facing, spread * density
    seen = open_ + grazed
    mean, beyond = spread * facing / seen, grazed / seen
    deviation = np.sqrt(1 + beyond - mean * mean)
    # As products, because NumPy's powers take twenty times as long.
    cubes = 2 * mean * mean * mean, deviation * deviation * deviation
    skew = (cubes[0] - (3 * mean + z) * beyond) / cubes[1]
    middle = (2 - (49 / 36) * skew * skew) / (3 - 0.25 * skew * skew)
    apart = (7 / 6 - 0.5 * middle) * skew / ROOT_3
    mirrored: Array = np.zeros_like(cosine)
    for node, weight in (
        (-ROOT_3 + 7 / 6 * skew, 0.5 * (1 - middle + apart)),
        (2 / 3 * skew, middle),
        (ROOT_3 + 7 / 6 * skew, 0.5 * (1 - middle - apart)),
    ):
        x = t * (mean + deviation * node)
        along = np.maximum(cosine + sine * x, 0)
        mirrored += weight * fresnel(along / np.sqrt(1 + t * t + x * x), index)
    return np.asarray(1 - mirrored)


def beckmann(cosine: Array, roughness: float) -> Array:
    """Return Beckmann's density of microfacets by the cosine of their angle to the normal."""
    square = cosine * cosine
    tangent = (1 - square) / square
    return np.asarray(np.exp(-tangent / roughness**2) / (np.pi * roughness**2 * square * square))


def masking(cosine: Array, roughness: float) -> Array:
    """Return the share of Beckmann's microfacets that are not hidden (Walter et al., eq. 27)."""
    a = cosine / (roughness * np.sqrt(np.maximum(1 - cosine * cosine, 1e-6)))
    near = (3.535 + 2.181 * a) * a / (1 + (2.276 + 2.577 * a) * a)
    return np.asarray(np.where(a < 1.6, near, 1))
