"""Increase the variance of a slope that its light contradicts, or that has a twin."""

from typing import Annotated, Any

import numpy as np
from annotated_types import Gt

from tactograph.graph import Close, Port, node
from tactograph.nodes import F4, Slope, SlopeVariance

USUAL_MISFIT = np.float32(12)
"""Misfit that noise explains."""
FLAT_SLOPE_SQUARE = np.float32(0.002)


@node(neutral="variance", tolerance=Close(0, 1e-5, why="rounding of products"))
def misfit_variance(
    variance: SlopeVariance,
    slope: Slope,
    twin: Slope,
    misfit: Annotated[F4, Port("H W", "1", high=100)],
    *,
    open_pairs: bool = False,
    steepest: Annotated[float, Gt(0)] = 4.0,
) -> SlopeVariance:
    """Return the variance of the slopes, including misfit and ambiguity.

    Where the light fits worse than noise explains, the variance grows with the misfit (W1).
    Two lights allow two normals.  Before any height is known the choice between them is a
    guess, with half their difference as its standard deviation.

    Parameters
    ----------
    variance : 2 x H x W, from the noise alone
    slope, twin : 2 x H x W, the chosen slope and the other slope that its light allows
    misfit : H x W, chi-square of the slope
    open_pairs
        Whether the choice between slope and twin is still a guess.  A slope near zero is never
        a guess: it is that of the film at rest, and could be zero only by coincidence.
    steepest : a steeper twin counts as this steep
    """
    wide = variance * np.maximum(misfit / USUAL_MISFIT, np.float32(1))
    if open_pairs:
        limit = np.float32(steepest)
        apart = np.clip(twin, -limit, limit) - slope
        tilted = slope[0] * slope[0] + slope[1] * slope[1] > FLAT_SLOPE_SQUARE
        differ = (twin != slope).any(axis=0)
        wide = wide + np.where(tilted & differ, np.float32(0.25) * apart * apart, 0)
    return np.asarray(wide, np.float32)


misfit_variance.opencl(grid="H W")


@misfit_variance.example
def _example(rng: np.random.Generator, H: int, W: int, **_: int) -> dict[str, Any]:
    """Twins that equal the slope, that differ from it, and that are too steep."""
    slope = rng.uniform(-1, 1, (2, H, W)).astype(np.float32)
    twin = np.where(rng.random((H, W)) < 0.3, slope, 8 * slope)
    return {"slope": slope, "twin": twin.astype(np.float32)}
