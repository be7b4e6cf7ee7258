"""Integrate slopes of different variance, with the height differences that shadows measure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from annotated_types import Ge, Interval

from tactograph.graph import Close, node
from tactograph.nodes import F4, Height, Mask, PixelSize, ShadowRises, Slope, SlopeVariance
from tactograph.nodes.height._height_solver import HeightSolver, find_touch
from tactograph.nodes.height._height_system import HeightSystem, contact_window, height_system
from tactograph.nodes.height._springs import conjugate_gradients, hierarchy

if TYPE_CHECKING:
    from tactograph.graph.backends.launch import Launch

ENOUGH = 4e-9
"""Stop when less than this share of the steps' energy is left to gain."""


@node(tolerance=Close(5e-4, 1e-4, why="conjugate gradients add up in another order"))
def integrate_weighted(
    slope: Slope,
    variance: SlopeVariance,
    rest: Mask,
    start: Height,
    rises: ShadowRises,
    pixel: PixelSize,
    mask: Mask | None = None,
    before: Height | None = None,
    *,
    rounds: Annotated[int, Interval(ge=1, le=50)] = 4,
    steps: Annotated[int, Interval(ge=1, le=1000)] = 8,
    robust: Annotated[float, Ge(0.1)] = 2.5,
    ease: Annotated[float, Ge(1)] = 1.0,
    bend: Annotated[float, Ge(0)] = 0.25,
    floor: Annotated[float, Ge(0.01)] = 0.07,
    rise_px: Annotated[float, Ge(0.05)] = 0.5,
) -> Height:
    """Return the height that best agrees with slopes, shadows and the film at rest.

    Minimises the sum of rho(r^2 / variance) over the steps to the right and downwards
    (r = z_next - z - step) and over the shadows (r = z_top - z_foot - rise), with z = 0 on
    the film at rest and Cauchy's rho(s) = c^2 log(1 + s / c^2), which limits the influence of
    outliers: across an edge no slope is right.  Each round updates the weights from the last
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
    mask
        H x W, 1 on the pixels that count; without it all count.  The height of the others is 0.
    before
        H x W in mm, the height of the previous touch in a stream.  If it fits better than
        `start`, it is the first height, outliers are suppressed at once (no `ease`), and half
        of the rounds are done.
    rounds, steps
        Number of rounds, and conjugate-gradient steps in each.
    robust
        c, in standard deviations.
    ease
        Factor by which the scale is larger for each round that remains: first least squares of
        everything, finally with the outliers suppressed (graduated non-convexity, Blake and
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
    window = contact_window(rest, mask)
    system = height_system(
        window,
        slope,
        variance,
        rest,
        rises,
        pixel,
        mask,
        bend=bend,
        floor=floor,
        rise_px=rise_px,
    )
    height, warm = system.cut(window.of(start)), False
    if before is not None:
        known = system.cut(window.of(before))
        warm = system.cost(known, robust) < system.cost(height, robust)
        height = known if warm else height
    scales = _scales(rounds, robust, ease, warm=warm)
    for scale in scales:
        last, height = height, _improve(system, height, scale, steps)
        # An unchanged height has the same weights: the remaining rounds would change nothing.
        if height is last and scale == scales[-1]:
            break
    out = np.zeros(rest.shape, np.float32)
    out[window.rows, window.columns] = height
    counts = np.ones_like(rest) if mask is None else mask
    if not (rest & counts).any():
        out -= _border_median(out, counts)
    return out * counts


def _scales(rounds: int, robust: float, ease: float, *, warm: bool) -> list[float]:
    """The scale of each round; a height that is nearly right needs half of them and no ease."""
    if warm:
        return [robust] * ((rounds + 1) // 2)
    return [robust * ease**left for left in reversed(range(rounds))]


def _improve(system: HeightSystem, height: F4, scale: float, steps: int) -> F4:
    """One round: weights from the height, then a better height."""
    springs = system.springs(height, scale)
    force = springs.pull(system.right, system.down, system.rise)
    enough = ENOUGH * springs.energy(system.right, system.down)
    return conjugate_gradients(hierarchy(springs), force, height, steps, enough)


def _border_median(height: F4, counts: Mask) -> np.float32:
    """The median over the frame's outermost pixels that count; 0 if none does."""
    border = np.ones(height.shape, bool)
    border[1:-1, 1:-1] = False
    found = height[border & (counts > 0)]
    return np.float32(np.median(found) if found.size else 0)


@integrate_weighted.opencl()
def _launch(run: Launch) -> None:
    size = run.sizes["H"], run.sizes["W"]
    settings, out = run.settings, run.outputs["integrate_weighted"]
    robust = settings["robust"]
    touch = find_touch(run)
    solver = HeightSolver(run, touch)
    height, warm = solver.cut(run.inputs["start"]), False
    if run.inputs.get("before") is not None:
        known = solver.cut(run.inputs["before"])
        warm = solver.cost(known, robust) < solver.cost(height, robust)
        height = known if warm else height
    scales = _scales(settings["rounds"], robust, settings["ease"], warm=warm)
    for scale in scales:
        solver.weigh(height, scale)
        enough = solver.enough(ENOUGH, solver.energies(solver.pixels, solver.wants))
        moved = solver.solve(solver.pixels, solver.wants, height, settings["steps"], enough)
        if scale == scales[-1] and not moved():
            break
    run.kernel("place", size, height, out, *size, *solver.place)
    mask = run.inputs.get("mask")
    if not touch.any_rest:
        counts = np.ones(size, np.uint8) if mask is None else run.download(mask)
        run.kernel("lower", size, out, *size, float(_border_median(run.download(out), counts)))
    if mask is not None:
        run.kernel("leave_out", size, mask, out, *size)


@integrate_weighted.example
def _example(rng: np.random.Generator, **sizes: int) -> dict[str, Any]:
    """Shadows with both ends in the frame; some slopes are not known; the film rests outside.

    Sometimes it rests nowhere.  Then all pixels count, because a part without any constraint
    could have any height.
    """
    rows, columns = sizes["H"], sizes["W"]
    number = rows * columns // 7
    rest = np.ones((rows, columns), np.uint8)
    rest[1 + rows // 8 : rows - rows // 5, columns // 6 : columns - columns // 8] = 0
    mask = (rng.random((rows, columns)) < 0.95).astype(np.uint8)
    if rng.random() < 0.2:
        rest[:], mask[:] = 0, 1
    variance = rng.uniform(1e-6, 1e-2, (2, rows, columns)).astype(np.float32)
    variance[:, rng.random((rows, columns)) < 0.1] = 1e12
    ends = rng.integers(0, rows * columns, (2, number)).astype(np.int32)
    return {
        "rest": rest,
        "variance": variance,
        "rises.top": ends[0],
        "rises.foot": ends[1],
        "rises.rise": rng.uniform(-0.2, 1, number).astype(np.float32),
        "rises.led": rng.integers(1, 5, number).astype(np.uint8),
        "before": rng.uniform(-0.1, 1, (rows, columns)).astype(np.float32),
        "mask": mask,
    }
