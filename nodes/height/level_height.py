"""Level the film at rest: remove a smooth error of the slopes over the frame."""

import math
from functools import lru_cache
from typing import Annotated, Any

import cv2
import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.graph import Close, SizeLimit, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, F8, CoarseLight, Grain, Height, robust_deviation
from tactograph.nodes.optics.cell_side import CellSide, cell_side, cells_by
from tactograph.nodes.optics.near_light import image_places

WINDOW_CELLS = 5
"""Side in cells over which calm light is averaged."""
MIN_REST_SHARE, MIN_CURVED_SHARE = 0.1, 0.3
"""Shares of the frame at rest below which nothing, and at most a plane, is fitted."""
FIT_ROUNDS = 5
"""Rounds of robust least squares, which give little weight to film that drapes around a touch."""
INNER_WEIGHT = 1e-6
"""Weight of cells inside the frame in the first round, for borders without film at rest."""
ENOUGH_CELLS = 8192
"""Enough cells for ten coefficients; of more cells, every n-th row and column is used."""
TERMS_OF = (1, 3, 6, 10)
"""Number of terms of a polynomial in x and y, by its degree."""
TERM_POWERS = [(degree - j, j) for degree in range(len(TERMS_OF)) for j in range(degree + 1)]
"""The exponents of u and v, x and y from the middle over half the width, by degree."""


@node(
    neutral="height",
    tolerance=Close(1e-3, share=2e-3, why="a threshold on calm light, sums in float32"),
    sizes={"K": SizeLimit(1, 8, "more LEDs than a label has bits")},
    derived=cells_by("cell"),
)
def level_height(
    height: Height,
    light: CoarseLight,
    grain: Grain,
    *,
    cell: CellSide = 4,
    degree: Annotated[int, Interval(ge=0, le=3)] = 3,
) -> Height:
    """Subtract a smooth surface through the film at rest.

    An error of the light of 0.1 % tilts the surface by 1 um per mm.  The true height of the film at
    rest is 0, so a polynomial fitted to its heights by robust least squares (Cauchy) estimates the
    error, from all calm film or from that at the frame's border, whichever leaves less.  If the
    grain is 0 there is no such error, and the height is returned unchanged.

    Parameters
    ----------
    height : H x W in mm
    light
        K x h x w on cells, relative to the film at rest; film is at rest where the light of all
        LEDs is 1 within the grain.
    grain : the film's grain, a share of the light
    cell : side of a cell in pixels, as for `coarsen`
    degree : degree of the polynomial in x and y

    Returns
    -------
    H x W in mm.
    """
    cell = cell_side(height.shape[0], height.shape[1], cell)
    rows, columns = (
        np.minimum(np.arange(cells) * cell + cell // 2, size - 1)
        for cells, size in zip(light.shape[1:], height.shape, strict=True)
    )
    sampled = height[rows[:, None], columns]
    coefficients = _surface(sampled, light, grain, degree)
    u, v = image_places(height.shape, 2 / height.shape[1])
    for c, (i, j) in zip(coefficients, TERM_POWERS, strict=True):
        if c:
            height = height - np.float32(c) * u**i * v**j
    return height


def _surface(sampled: F4, light: F4, grain: float, degree: int) -> F4:
    """The ten coefficients of the surface through the film at rest, from one height per cell."""
    none = np.zeros(len(TERM_POWERS), np.float32)
    if not grain > 0:
        return none
    window = (WINDOW_CELLS, WINDOW_CELLS)
    mean = [cv2.blur(plane, window, borderType=cv2.BORDER_REPLICATE) for plane in light]
    calm = (np.abs(np.stack(mean) - 1) < grain).all(axis=0)
    calm &= np.isfinite(sampled)
    if calm.mean() < MIN_REST_SHARE:
        return none
    used = TERMS_OF[degree if calm.mean() >= MIN_CURVED_SHARE else min(degree, 1)]
    apart = math.ceil(math.sqrt(calm.size / ENOUGH_CELLS))
    terms, calm = _terms(sampled.shape, apart), calm[::apart, ::apart]
    basis = np.compress(calm.ravel(), terms[:used], axis=1)
    z = sampled[::apart, ::apart][calm].astype(np.float64)
    # Film on the flat top of an object is as calm as the film at rest, but higher.  So rounds that
    # begin with the frame's border compete with those that begin with all calm film.
    border = np.ones_like(calm)
    border[1:-1, 1:-1] = False
    starts = [np.ones(z.size), border[calm] + INNER_WEIGHT]
    fits = [_robust(basis, z, weight) for weight in starts]
    none[:used] = min(fits, key=lambda fit: fit[1])[0]
    return none


def _robust(basis: F8, z: F8, weight: F8) -> tuple[F8, float]:
    """Fit by Cauchy's weights, after a first round with these; also the residuals' deviation."""
    for _ in range(FIT_ROUNDS):
        sure = basis * weight
        square = sure @ basis.T
        ridge = 1e-9 * np.trace(square) * np.eye(len(basis))
        coefficients = np.linalg.solve(square + ridge, sure @ z)
        residual = z - coefficients @ basis
        spread = float(robust_deviation(residual)) + 1e-9
        weight = 1 / (1 + (residual / spread) ** 2)
    return coefficients, spread


@lru_cache(maxsize=8)
def _terms(shape: tuple[int, int], apart: int) -> NDArray[np.float64]:
    """The terms of the surface at every n-th row and column of cells, in order: 10 x N."""
    u, v = image_places(shape, 2 / shape[1])
    u, v = u[:, ::apart], v[::apart]
    terms = [(u**i * v**j + 0 * (u + v)).ravel() for i, j in TERM_POWERS]
    return np.array(terms, np.float64)


@level_height.opencl()
def _launch(run: Launch) -> None:
    """Download the heights and the light of cells; send back ten coefficients."""
    height, light, out = run.inputs["height"], run.inputs["light"], run.outputs["level_height"]
    rows, columns = run.sizes["H"], run.sizes["W"]
    cell = cell_side(rows, columns, run.settings["cell"])
    cells = run.sizes["h"], run.sizes["w"]
    coefficients = np.zeros(len(TERM_POWERS), np.float32)
    grain = float(run.inputs["grain"])
    if grain > 0:
        sampled = run.scratch(cells)
        run.kernel("sample_cells", cells, height, sampled, rows, columns, *cells, cell)
        settings = grain, int(run.settings["degree"])
        lit = run.begin_download(light)
        coefficients = _surface(run.download(sampled), lit(), *settings)
    lanes = run.in_lanes(rows, columns)
    run.kernel("take_off", lanes, height, out, rows, columns, *map(float, coefficients))


@level_height.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, h: int, w: int) -> dict[str, Any]:
    """A film at rest that lies on a smooth surface, touched at one side."""
    u, v = image_places((H, W), 2 / W)
    height = sum(rng.uniform(-0.05, 0.05) * u**i * v**j for i, j in TERM_POWERS)
    touched = np.broadcast_to(u > 0.5, (H, W))
    light = np.ones((K, h, w))
    light[:, :, 3 * w // 4 :] = 1.3
    return {"height": height + 0.5 * touched, "light": light, "grain": 0.02}
