"""Whether a stream still sees what it saw in a frame that it remembers."""

import math
from typing import NamedTuple

import numpy as np

from tactograph.graph import node
from tactograph.nodes import F4, Light, Still

CHANCE_SIGMAS = 3.0
"""Standard deviations of chance beyond which pixels have changed together."""
APART_PX = 2
"""Distance of the pixels that are compared; a lens's correction mixes the noise of nearer ones."""


class LightStays(NamedTuple):
    """Whether the light has stayed as it was, and the light to compare the next item's with."""

    still: Still
    reference: Light


@node
def light_stays(light: Light, sigma: Light, before: Light | None = None) -> LightStays:
    """Return whether light has changed by noise alone.

    Noise differs from pixel to pixel; what moves changes pixels together.  So the change is
    correlated with itself two pixels on: of N values of noise the coefficient departs from 0 by
    1 / sqrt(N), however large the noise is.

    Parameters
    ----------
    light : K x H x W, relative to the film at rest
    sigma : K x H x W, its standard deviation, of which only the course over the image counts
    before : this node's own ``reference`` of the item before (``previous.NODE.reference``)

    Returns
    -------
    ``still``, 0 or 1, and ``reference``: `light` at the first item and where it has moved, else
    `before`, so that slow motion adds up.
    """
    if before is None or _moves((light - before) / sigma):
        return LightStays(0.0, light.copy())
    return LightStays(1.0, before)


def _moves(change: F4) -> bool:
    """Whether pixels changed together: K x H x W."""
    change -= change.mean(axis=(1, 2), keepdims=True)
    down = change[:, APART_PX:], change[:, :-APART_PX]
    across = change[:, :, APART_PX:], change[:, :, :-APART_PX]
    return any(_go_together(*pair) for pair in (down, across))


def _go_together(one: F4, other: F4) -> bool:
    """Whether two arrays are correlated by more than chance."""
    together = abs(np.vdot(one, other))
    squares = float(np.square(one).sum() * np.square(other).sum())
    return bool(together > CHANCE_SIGMAS * math.sqrt(squares / one.size))
