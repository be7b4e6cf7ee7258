"""Mark no film as at rest, for sensors whose light drifts too much to find it."""

import numpy as np

from tactograph.graph import node
from tactograph.nodes import Light, Mask


@node
def no_rest(flat: Light) -> Mask:
    """Return 0 at every pixel of the flat frame (K x H x W)."""
    return np.zeros(flat.shape[1:], np.uint8)
