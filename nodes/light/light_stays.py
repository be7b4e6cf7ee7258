"""Decide whether the light of a stream has changed since a reference frame."""

import math
from typing import NamedTuple

import numpy as np

from tactograph.graph import node
from tactograph.nodes import F4, Light, Still

CHANCE_SIGMAS = 3.0
"""Standard deviations beyond which a correlation is no chance."""
APART_PX = 2
"""Distance of the pixels that are compared; resampling by a lens mixes the noise of nearer ones."""


class LightStays(NamedTuple):
    """Whether the light is unchanged, and the light to compare the next item with."""

    still: Still
    reference: Light


@node
def light_stays(light: Light, sigma: Light, before: Light | None = None) -> LightStays:
    """Return whether light has changed by noise alone.

    Noise is independent from pixel to pixel; motion changes neighbouring pixels together.  So the
    change is correlated with itself shifted by two pixels.  For N values of noise the coefficient
    has a standard deviation of 1 / sqrt(N), however large the noise is.

    Parameters
    ----------
    light : K x H x W, relative to the film at rest
    sigma : K x H x W, its standard deviation, up to a constant factor
    before : this node's ``reference`` for the previous item (``previous.NODE.reference``)

    Returns
    -------
    ``still``, 0 or 1, and ``reference``: `light` for the first item and after a motion, else
    `before`, so that slow motion adds up.
    """
    if before is None or _moves((light - before) / sigma):
        return LightStays(0.0, light.copy())
    return LightStays(1.0, before)


def _moves(change: F4) -> bool:
    """Whether neighbouring pixels changed together, K x H x W."""
    change -= change.mean(axis=(1, 2), keepdims=True)
    down = change[:, APART_PX:], change[:, :-APART_PX]
    across = change[:, :, APART_PX:], change[:, :, :-APART_PX]
    return any(_go_together(*pair) for pair in (down, across))


def _go_together(one: F4, other: F4) -> bool:
    """Whether two arrays are correlated beyond chance."""
    together = abs(np.vdot(one, other))
    squares = float(np.square(one).sum() * np.square(other).sum())
    return bool(together > CHANCE_SIGMAS * math.sqrt(squares / one.size))
