"""Light that was added to a touch, the same everywhere."""

from typing import Annotated

import numpy as np

from tactograph.graph import Port, node
from tactograph.nodes import DEVIATIONS_PER_MAD, F4, F8, CoarseLight
from tactograph.nodes.trust._check import thinned
from tactograph.nodes.trust._rest_evidence import DARK_LIGHT

MIN_EXPLAINED = 0.7
"""Share of the light's changes beside each LED's own that added light has to explain."""
ADDED_ROUNDS, ADDED_NOISE = 10, 1e-3
"""Rounds of robust least squares, and departure of the light that counts as noise."""


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
    seen, by_added = light.astype(np.float64), 1 / np.maximum(flat, DARK_LIGHT).astype(np.float64)
    weight = np.ones(seen.shape[1])
    for _ in range(ADDED_ROUNDS):
        shape, change = (a - np.average(a, 1, weight)[:, None] for a in (by_added, seen))
        square = np.average((shape * shape).mean(axis=0), weights=weight)
        added = np.average((shape * change).mean(axis=0), weights=weight) / max(square, 1e-12)
        left = np.square(change - added * shape).mean(axis=0)
        weight = calm_weight(left)
    explained = added**2 * square
    if explained <= MIN_EXPLAINED * (explained + np.average(left, weights=weight)):
        return 0.0
    return float(added * np.average(by_added.mean(axis=0), weights=weight))


def calm_weight(left: F8) -> F8:
    """Return the weight of cells whose squared residual is `left`: touched film drops out.

    It is that of Geman and McClure, "Statistical methods for tomographic image reconstruction",
    1987, beside the cells' own median and the noise.
    """
    noise = DEVIATIONS_PER_MAD**2 * np.median(left) + ADDED_NOISE**2
    return np.asarray(1 / (1 + left / noise) ** 2)
