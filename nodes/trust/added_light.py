"""Light that was added to a touch, the same everywhere."""

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes.trust._explained import explained
from tactograph.nodes.trust.checked_cells import DARK_LIGHT


def added_share(light: F4, flat: F4) -> float:
    """Return the light that was added everywhere, over that of the film at rest (T3); 0: none.

    Dim film then departs more than bright film.

    Parameters
    ----------
    light : K x N, of cells that lie anywhere, relative to the flat frame
    flat : K x N, the film at rest on the same cells
    """
    by_added = np.asarray(1 / np.maximum(flat, DARK_LIGHT), np.float32)
    return float(explained(light, by_added[None])[0] * by_added.mean())
