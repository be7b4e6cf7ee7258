"""A rough dielectric coat: the light that microfacets mirror, hide and let through (equation F3).

Beckmann's distribution; B. Walter et al., "Microfacet models for refraction through rough
surfaces", 2007.  All functions take cosines of any shape;
``kernels/headers/coat.clh`` is the same.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from tactograph.graph.backends.launch import DeviceArray, Launch

Array = NDArray[Any]

NORMAL_TAIL_POWERS = 0.4361836, -0.1201676, 0.9372980
"""The tail of the normal distribution in powers of 1 / (1 + 0.33267 z) (Abramowitz and Stegun,
26.2.16)."""

ROOT_3 = 3**0.5

MIN_COSINE = 0.05
"""Smallest cosine for which a coat is evaluated."""
LET_IN_TERMS = 10
"""Number of terms of the polynomial that approximates T of one coat."""


def fresnel(cosine: Array, index: float) -> Array:
    """Return the share of unpolarised light that a dielectric mirrors."""
    g = np.sqrt(index * index - 1 + cosine * cosine)
    more, less = g + cosine, g - cosine
    over, under = cosine * more - 1, cosine * less + 1
    part = less / (more * under)
    return np.asarray(0.5 * part * part * (under * under + over * over))


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
    facing = 1 - density * w * (
        NORMAL_TAIL_POWERS[0] + w * (NORMAL_TAIL_POWERS[1] + w * NORMAL_TAIL_POWERS[2])
    )
    open_, grazed = cosine * facing, spread * density
    transmitted = open_ + grazed
    mean, beyond = spread * facing / transmitted, grazed / transmitted
    deviation = np.sqrt(1 + beyond - mean * mean)
    # Products, because NumPy's powers take twenty times as long.
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


@lru_cache(maxsize=64)
def let_in_curve(roughness: float, index: float) -> Array:
    """Return T of one coat as a polynomial in 2 c - 1, for cosines c from `MIN_COSINE` to 1.

    It is fitted at Chebyshev's nodes, and departs from `let_in` by less than 2e-5 for a roughness
    of 0.2, and by less than 5e-4 for 0.05.
    """
    turns = (np.arange(4 * LET_IN_TERMS) + 0.5) * np.pi / (4 * LET_IN_TERMS)
    cosines = MIN_COSINE + (1 - MIN_COSINE) * (1 + np.cos(turns)) / 2
    powers = np.vander(2 * cosines - 1, LET_IN_TERMS, increasing=True)
    share = let_in(cosines, roughness, index) if index != 1 else np.ones_like(cosines)
    return np.asarray(np.linalg.lstsq(powers, share)[0])


def let_in_by(curve: Array, cosine: Array) -> Array:
    """Return the share T of light that a coat lets through, from its `let_in_curve`."""
    curve = curve.astype(cosine.dtype)
    x = 2 * cosine - 1
    total = np.full_like(x, curve[-1])
    for term in curve[-2::-1]:
        total *= x
        total += term
    return total


def let_in_change(curve: Array, cosine: Array) -> Array:
    """Return the derivative of `let_in_by` with respect to the cosine."""
    return let_in_by(2 * np.arange(1, len(curve)) * curve[1:], cosine)


def upload_curve(run: Launch, roughness: float, index: float) -> DeviceArray:
    """Return a coat's `let_in_curve` on the device."""
    key = "what a coat lets in", roughness, index
    return run.keep(key, lambda: run.put(let_in_curve(roughness, index).astype(np.float32)))


def beckmann(cosine: Array, roughness: float) -> Array:
    """Return Beckmann's density of microfacets at this cosine of their angle to the normal."""
    square = cosine * cosine
    tangent = (1 - square) / square
    return np.asarray(np.exp(-tangent / roughness**2) / (np.pi * roughness**2 * square * square))


def masking(cosine: Array, roughness: float) -> Array:
    """Return the share of Beckmann's microfacets that are not hidden (Walter et al., eq. 27)."""
    a = cosine / (roughness * np.sqrt(np.maximum(1 - cosine * cosine, 1e-6)))
    near = (3.535 + 2.181 * a) * a / (1 + (2.276 + 2.577 * a) * a)
    return np.asarray(np.where(a < 1.6, near, 1))
