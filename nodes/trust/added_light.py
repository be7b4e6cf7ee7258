"""Light that was added to a touch, the same everywhere."""

from typing import Annotated

import numpy as np

from tactograph.graph import Port, node
from tactograph.nodes import F4, CoarseLight
from tactograph.nodes.trust._check import thinned
from tactograph.nodes.trust._explained import explained
from tactograph.nodes.trust._rest_evidence import DARK_LIGHT


@node
def added_light(light: CoarseLight, flat: CoarseLight) -> Annotated[float, Port(unit="1")]:
    """Return the light that was added everywhere, over that of the film at rest (T3); 0: none.

    Dim film then departs more than bright film.

    Parameters
    ----------
    light : K x h x w on cells, relative to the flat frame, before any drift is taken out
    flat : K x h x w, the film at rest on the same cells
    """
    return added_share(*(thinned(a).reshape(len(a), -1) for a in (light, flat)))


def added_share(light: F4, flat: F4) -> float:
    """Return the same of cells that lie anywhere, K x N each."""
    by_added = np.asarray(1 / np.maximum(flat, DARK_LIGHT), np.float32)
    return float(explained(light, by_added[None])[0] * by_added.mean())
