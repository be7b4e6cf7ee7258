"""One rule for all causes of a change on the film at rest (T3): they have to explain the light."""

import numpy as np

from tactograph.nodes import DEVIATIONS_PER_MAD, F4, F8
from tactograph.nodes.trust.checked_cells import DARK_LIGHT
from tactograph.nodes.trust.light_departure import MIN_ERROR

EXPLAINED_SHARE = 0.8
"""Share of a departure that a mistake has to explain to be named: four times as much as all other
causes."""
FIT_ROUNDS = 5
"""Rounds of robust least squares; touched film drops out in the first."""


def explains(residual: float, departure: float) -> bool:
    """Return whether a mean squared departure is explained, by the residual that remains of it."""
    return residual < (1 - EXPLAINED_SHARE) * departure


def explained(change: F4, causes: F4) -> F8:
    """Return how much of each cause explains a change of the light; 0 if they explain too little.

    The solution is robust least squares, regularised by the error of the light, with a free gain
    for each LED.  Cells that fit badly count less, by the weight of S. Geman and D. McClure,
    "Statistical methods for tomographic image reconstruction", 1987.

    Parameters
    ----------
    change : K x N, the change of the light of N cells
    causes : M x K x N, the change by one unit of each cause
    """
    planes, count = np.concatenate([causes, change[None]]).astype(np.float64), len(causes)
    ridge = MIN_ERROR**2 * change.size * np.eye(count)
    weight = np.ones(change.shape[1])
    for _ in range(FIT_ROUNDS):
        even = planes - (planes @ (weight / weight.sum()))[..., None]
        rows = even.reshape(count + 1, -1)
        square = (even * weight).reshape(count + 1, -1) @ rows.T
        weights = np.linalg.solve(square[:count, :count] + ridge, square[:count, count])
        residual = (
            np.square(rows[count] - weights @ rows[:count]).reshape(change.shape).mean(axis=0)
        )
        middle = residual.size // 2  # np.median takes four times as long
        noise = DEVIATIONS_PER_MAD**2 * np.partition(residual, middle)[middle] + MIN_ERROR**2
        weight = 1 / (1 + residual / noise) ** 2
    shares = weight / weight.sum()
    whole = np.square(even[count]).mean(axis=0)
    return weights if explains(residual @ shares, whole @ shares) else np.zeros(count)


def added_share(light: F4, flat: F4) -> float:
    """Return the light that was added everywhere, relative to the film at rest (T3); 0: none.

    Dim film then departs more than bright film.

    Parameters
    ----------
    light : K x N, of any N cells, relative to the flat frame
    flat : K x N, the film at rest on the same cells
    """
    by_added = np.asarray(1 / np.maximum(flat, DARK_LIGHT), np.float32)
    return float(explained(light, by_added[None])[0] * by_added.mean())
