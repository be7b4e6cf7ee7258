"""Integrate slopes of different variance, with the height differences that shadows measure."""

from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Interval

from tactograph.graph import Close, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, U1, Height
from tactograph.nodes.height.height_equations import STATE_AWAY, HeightSystem
from tactograph.nodes.height.height_networks import HeightNetworks
from tactograph.nodes.height.height_solver import HeightSolver
from tactograph.nodes.height.height_system import example_system
from tactograph.nodes.height.springs import conjugate_gradients, hierarchy
from tactograph.nodes.light.border import border_of

MIN_ENERGY_SHARE = 4e-9
"""Stop when the remaining gain is less than this share of the steps' energy."""
MAX_SCALE = 1e15
"""Upper bound on c, far above any residual; its square still fits into a float32."""


@node(tolerance=Close(5e-4, 1e-4, why="conjugate gradients sum in another order"))
def integrate_weighted(
    system: HeightSystem,
    start: Height,
    before: Height | None = None,
    *,
    rounds: Annotated[int, Interval(ge=1, le=50)] = 4,
    steps: Annotated[int, Interval(ge=1, le=1000)] = 8,
    ease: Annotated[float, Ge(1)] = 1.0,
) -> Height:
    """Return the height that agrees best with slopes, shadows and the film at rest.

    It minimises the sum of rho(r^2 / variance) (H1) over the steps to the right and downwards
    (r = z_next - z - step) and over the shadows (r = z_top - z_foot - rise), with z = 0 on
    the film at rest and Cauchy's rho(s) = c^2 log(1 + s / c^2), which limits the influence of
    outliers: across an edge no slope is right.  Shadows are outliers only while they are few
    (`HeightSystem.springs`).  Each round updates the weights from the last height (iteratively
    reweighted least squares) and improves the height by conjugate gradients, preconditioned by
    multigrid (`springs`).

    The steps across a rim err alike, as no slope shows its wall, and as one measurement they would
    have little weight.  Rises err independently, so their median is right: by the height's median
    departure from them, all are lifted for the next round (Uzawa's method for the constraint that
    it is zero), less what they may err alike (James and Stein's estimator).

    Parameters
    ----------
    system
        The equations of `height_system`.  If no film is at rest, the border's median is set to
        zero.
    start : H x W in mm, the initial height
    before
        H x W in mm, the height of the previous touch in a stream.  If it fits better than `start`
        it is the initial height; then outliers are suppressed at once (no `ease`), and half of the
        rounds suffice.
    rounds, steps : number of rounds, and conjugate-gradient steps in each
    ease
        Factor by which c is larger for each remaining round: the first round is nearly plain least
        squares, the last suppresses outliers (graduated non-convexity: A. Blake and A. Zisserman,
        "Visual reconstruction", 1987).

    Returns
    -------
    H x W in mm; 0 where pixels do not count.
    """
    height, warm, robust = system.cut(start), False, float(system.scales[2])
    if before is not None:
        before_cut = system.cut(before)
        warm = system.cost(before_cut, robust) < system.cost(height, robust)
        height = before_cut if warm else height
    scales, rise = _scales(rounds, robust, ease, warm=warm), system.rise
    for number, scale in enumerate(scales):
        springs = system.springs(height, scale)
        if number:
            rise = rise - system.disagreement(height, scale)
        force = springs.pull(*system.steps, rise)
        enough = MIN_ENERGY_SHARE * springs.energy(*system.steps)
        last, height = height, conjugate_gradients(hierarchy(springs), force, height, steps, enough)
        # An unchanged height has the same weights: the remaining rounds would change nothing.
        if height is last and scale == scales[-1]:
            break
    counts, rows, columns = system.state != STATE_AWAY, *system.window
    out = np.zeros(start.shape, np.float32)
    out[rows, columns] = height * counts
    if not system.anchored[0]:
        out[rows, columns] -= _border_median(out, system.state, rows, columns) * counts
    return out


def _scales(rounds: int, robust: float, ease: float, *, warm: bool) -> list[float]:
    """The scale c of each round; a `warm` start needs half of the rounds and no ease."""
    if warm:
        return [robust] * ((rounds + 1) // 2)
    return [min(robust * ease**remaining, MAX_SCALE) for remaining in reversed(range(rounds))]


def _border_median(height: F4, state: U1, rows: slice, columns: slice) -> np.float32:
    """The median over the frame's outermost pixels that count; 0 if none counts.

    If no film is at rest, all pixels that count lie inside the window.
    """
    counts = np.zeros(height.shape, bool)
    counts[rows, columns] = state != STATE_AWAY
    border = border_of(height, 1)[border_of(counts, 1)]
    return np.float32(np.median(border) if border.size else 0)


@integrate_weighted.opencl()
def _launch(run: Launch) -> None:
    size = run.sizes["H"], run.sizes["W"]
    settings, out = run.settings, run.outputs["integrate_weighted"]
    networks = HeightNetworks(run)
    solver = HeightSolver(run, networks)
    height, warm = networks.cut(run.inputs["start"]), False
    if run.inputs.get("before") is not None:
        start = networks.cut(run.inputs["before"])
        warm = networks.cost(start, networks.robust) < networks.cost(height, networks.robust)
        height = start if warm else height
    scales = _scales(settings["rounds"], networks.robust, settings["ease"], warm=warm)
    wants = networks.wants._replace(rise=run.scratch((1, networks.rises)))
    for number, scale in enumerate(scales):
        networks.weigh(height, scale, wants.rise, int(number > 0))
        enough = networks.enough(MIN_ENERGY_SHARE, networks.pixels, wants)
        solver.solve(networks.pixels, wants, height, settings["steps"], enough)

    def place(by: float) -> None:
        run.kernel("place", size, height, networks.state, out, by, *size, *networks.place)

    place(0.0)
    if not networks.anchored:
        state = run.download(networks.state)
        place(float(_border_median(run.download(out), state, *networks.window)))


@integrate_weighted.example
def _example(rng: np.random.Generator, **sizes: int) -> dict[str, Any]:
    """The equations of rough film; sometimes the previous height fits better, along rows alone.

    A weakly constrained pixel keeps most of a start that is far off.
    """
    shape = sizes["H"], sizes["W"]
    slope = rng.uniform(-2, 2, (2, *shape)).astype(np.float32)
    before, start = rng.uniform(-0.1, 1, (2, *shape)).astype(np.float32)
    if rng.random() < 0.5:
        before[:] = rng.uniform(-2, 6, (sizes["H"], 1))
    return {**example_system(rng, slope, **sizes), "before": before, "start": start}
