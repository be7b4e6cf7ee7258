"""The surface before any measurement: the film at rest."""

from typing import NamedTuple

import numpy as np

from tactograph.graph import node
from tactograph.nodes import Height, Light, Slope


class Surface(NamedTuple):
    """A height and its slope."""

    height: Height
    slope: Slope


@node
def untouched_film(flat: Light) -> Surface:
    """Return height and slope zero, as large as the flat frame (K x H x W)."""
    size = flat.shape[1:]
    return Surface(np.zeros(size, np.float32), np.zeros((2, *size), np.float32))
