"""Find contradictions between slopes: the gradient of a surface has no curl."""

from typing import Annotated, Any

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray

from tactograph.graph import Close, Port, node
from tactograph.nodes import F4, FULL_MISFIT_SLOPE, Labels, Misfit, Slope, SlopeVariance
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.optics.cell_side import CellSide, cell_side, cells_by
from tactograph.nodes.trust.checked_cells import MIN_LEDS, NOT_TESTED

CoarseCurl = Annotated[F4, Port("h w", "1", low=-1, high=25)]
"""Squared curl over its expected square on a surface; -1 where there is no test."""


@node(
    derived=cells_by("factor"),
    tolerance=Close(1e-3, 5e-3, share=5e-3, why="slopes and curvatures at the limit of a test"),
)
def slope_curl(
    slope: Slope,
    misfit: Misfit,
    used: Labels | None = None,
    variance: SlopeVariance | None = None,
    *,
    factor: CellSide = 1,
    cell_px: Annotated[int, Interval(ge=1, le=64)] = 1,
    share: Annotated[float, Gt(0)] = 0.15,
    least: Annotated[float, Gt(0)] = 0.001,
) -> CoarseCurl:
    """Return the squared curl of the slopes between four cells, over its expected square.

    A surface z has dp/dy = dq/dx.  Images that are reordered or mirrored, or of another sensor or
    touch, give slopes that curl as much as they change.  Between four neighbouring cells, with
    differences of the cells' mean slopes::

        c = dp/dy - dq/dx,    D^2 = |grad p|^2 + |grad q|^2
        c^2 / (var p + var q + level^2 + (share D)^2 + least^2)                              (T2)

    The variances are those of the four cells' means; level is the calibration's misfit.

    Parameters
    ----------
    slope : 2 x H x W
    misfit : length 5, the calibration's misfit; its first number is the level, in radians
    used
        H x W, the LEDs that each slope rests on; with fewer than three there is no test.  None:
        all LEDs.
    variance : 2 x H x W, of a single pixel's noise; None: zero
    factor : side of a cell in pixels of `slope`; 0 depends on the image
    cell_px : side in camera pixels of a pixel of `slope`, which averages their noise
    share : curl over curvature that a surface shows, because cells have a size
    least : curl that any sensor shows

    Returns
    -------
    h x w, between a cell and those right of and below it; -1 in the last row and column, and on
    level film.
    """
    side = cell_side(slope.shape[1], slope.shape[2], factor)
    p, q = coarsen(slope, factor=side)
    out = np.full(p.shape, NOT_TESTED, np.float32)
    if min(p.shape) < 2:
        return out
    (p_right, p_down), (q_right, q_down) = _changes(p), _changes(q)
    curl = p_down - q_right
    bent = p_right**2 + p_down**2 + q_right**2 + q_down**2
    squared = np.minimum.reduce(_corners(p * p + q * q))
    tests = squared > FULL_MISFIT_SLOPE * FULL_MISFIT_SLOPE
    if used is not None:
        leds = np.bitwise_count(used[::side, ::side])
        tests &= np.minimum.reduce(_corners(leds)) >= MIN_LEDS
    expected = np.float32(least * least + float(misfit[0]) ** 2) + np.float32(share * share) * bent
    if variance is not None:
        a, b, c, d = _corners(coarsen(variance, factor=side).sum(axis=0))
        mean = (a + b + (c + d)) * np.float32(0.25)
        expected = expected + mean / np.float32((side * cell_px) ** 2)
    out[:-1, :-1] = np.where(tests, curl * curl / expected, NOT_TESTED)
    return out


def _corners(plane: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """The upper left, upper right, lower left and lower right cell of all blocks of four."""
    return plane[:-1, :-1], plane[:-1, 1:], plane[1:, :-1], plane[1:, 1:]


def _changes(plane: F4) -> tuple[F4, F4]:
    """The change from left to right, and from top to bottom, within four cells."""
    a, b, c, d = _corners(plane)
    return (b - a + (d - c)) * np.float32(0.5), (c - a + (d - b)) * np.float32(0.5)


slope_curl.opencl(grid="h w", lanes="rows")


@slope_curl.example
def _example(rng: np.random.Generator, H: int, W: int, **_: int) -> dict[str, Any]:
    """Slopes of a smooth surface with an edge across it, and some slopes that no surface has."""
    down, across = np.mgrid[:H, :W] / 7
    surface = np.stack([np.cos(across) * np.sin(down), np.sin(across) * np.cos(down)]) * 0.6
    surface[0, :, W // 2 :] -= 0.8
    curls = rng.normal(0, 0.05, (2, H, W)) * (rng.random((H, W)) < 0.5)
    return {
        "slope": (surface + curls).astype(np.float32),
        "used": rng.choice([7, 15, 3], (H, W), p=[0.3, 0.6, 0.1]).astype(np.uint8),
        "variance": rng.uniform(1e-5, 1e-4, (2, H, W)).astype(np.float32),
        "misfit": np.array([0.003, 1, 0.004, 0.05, 0.002], np.float32),
    }
