"""Integrate slopes that deserve different trust, with the heights that shadows measure."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Interval

from tactograph.graph import node
from tactograph.nodes import F4, Height, Mask, PixelSize, ShadowRises, Slope, SlopeVariance
from tactograph.nodes._height_system import HeightSystem, contact_window, height_system
from tactograph.nodes._springs import conjugate_gradients, hierarchy

ENOUGH = 1e-4


@node
def integrate_weighted(
    slope: Slope,
    variance: SlopeVariance,
    rest: Mask,
    start: Height,
    rises: ShadowRises,
    pixel: PixelSize,
    *,
    rounds: Annotated[int, Interval(ge=1, le=50)] = 4,
    steps: Annotated[int, Interval(ge=1, le=1000)] = 8,
    robust: Annotated[float, Gt(0)] = 2.0,
    ease: Annotated[float, Ge(1)] = 1.0,
    bend: Annotated[float, Ge(0)] = 0.5,
    floor: Annotated[float, Gt(0)] = 0.05,
    rise_px: Annotated[float, Gt(0)] = 0.5,
) -> Height:
    """Return the height that agrees best with slopes, shadows and the film at rest.

    Minimises the sum of rho(r^2 / variance) over the steps to the right and downwards
    (r = z_next - z - step) and over the shadows (r = z_top - z_foot - rise), with z = 0 on
    the film at rest and Cauchy's rho(s) = c^2 log(1 + s / c^2), which gives up what does
    not fit: across an edge no slope is right.  Each round renews the weights from the last
    height (iteratively reweighted least squares) and improves the height by conjugate
    gradients, preconditioned by multigrid (`_springs`).

    Parameters
    ----------
    slope, variance
        2 x H x W; the variance of p and q.
    rest
        H x W, 1 on the film at rest.  Where there is none, the border's median is zero.
    start
        H x W in mm, a first height.
    rises
        The C measurements of `shadow_constraints`.
    pixel
        mm per px.
    rounds, steps
        How often the weights are renewed, and conjugate gradients after each renewal.
    robust
        c, in standard deviations.
    ease
        The scale starts so much larger per round that is left: at first the least squares
        of everything, at last the outliers given up (graduated non-convexity, Blake and
        Zisserman, "Visual reconstruction", 1987).
    bend
        Error of a step, in px, per difference of the slopes at its ends.
    floor
        Error of every step, in px; limits the contrast of the weights.
    rise_px
        Standard deviation of a shadow's rise, in px.

    Returns
    -------
    ndarray
        H x W in mm.
    """
    window = contact_window(rest)
    system = height_system(
        window,
        slope,
        variance,
        rest,
        rises,
        pixel,
        bend=bend,
        floor=floor,
        rise_mm=rise_px * pixel,
    )
    height = np.where(system.at_rest > 0, np.float32(0), window.of(start))
    for left in reversed(range(rounds)):
        height = _improve(system, height, robust * ease**left, steps)
    out = np.zeros(rest.shape, np.float32)
    out[window.rows, window.columns] = height
    return out if rest.any() else out - np.float32(np.median(_border(out)))


def _improve(system: HeightSystem, height: F4, scale: float, steps: int) -> F4:
    """One round: weights from the height, then a better height."""
    springs = system.springs(height, scale)
    force = springs.pull(system.right, system.down, system.rise)
    return conjugate_gradients(hierarchy(springs), force, height, steps, ENOUGH)


def _border(height: F4) -> F4:
    return np.concatenate([height[0], height[-1], height[:, 0], height[:, -1]])
