"""What the cells of a film throw on one another: a sweep over azimuths with a rising horizon.

The half-space above a cell at P is cut into half-planes that contain the camera's ray at P.
The sweep visits the film in such a plane in growing steps.  A place that rises above the horizon
of those before it, from t_0 to t_1 in t = tan(elevation), throws light on P::

    B(P) = albedo / pi sum L(P, Q) [F(t_1) - F(t_0)] dphi,
    F(t) = n_h / 2 (atan t + t / (1 + t^2)) + n_e / 2 t^2 / (1 + t^2)                         (B1)

with n_e and n_h the normal's components along the ray and perpendicular to it, in the plane, and F
the integral of cosine and solid angle.  The first horizon is the film's own tangent, so a convex
film does not light itself, and what nearer film hides throws nothing (horizons: Max 1988).
Whatever rises from the camera's ray at P appears in its image in order, near or far away, so such
a plane is a line of the image.  ``kernels/headers/sweep.clh`` holds the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4
from tactograph.nodes.light._film import to_pupil
from tactograph.nodes.light._radiosity import Cells, Grid

MATT_AZIMUTHS, COATED_AZIMUTHS = 16, 32
"""Number of azimuths; what a coat mirrors is narrower than the light of matt film."""
GROWTH = 8
"""Cells of distance after which a step is one cell longer, ..."""
LONGEST = 8
"""... and the longest step."""
LEAST_FACING = np.float32(1e-3)
"""Smallest n_e."""

Numbers = NDArray[np.intp]
Law = Callable[[Numbers, F4, Numbers], F4]
"""How cells throw light on one another: from N cells of the frame, by number, directions 3 x N and
N of all cells, by number, to light K x N."""


class Sight(NamedTuple):
    """What the cells of the frame see along an azimuth: N pairs of cells, by number."""

    share: F4
    """Share of the light that arrives, N."""
    direction: F4
    """To the other cell, 3 x N."""
    here: Numbers
    there: Numbers
    """Among all cells."""


class Looking(NamedTuple):
    """The cells of the frame along one azimuth; the horizon and F there rise during the sweep.

    The camera sees other heights, but straight lines stay straight: what rises over the horizon
    in its image does so on the film.  Most steps see nothing rise, and the image shows that with
    less computation.
    """

    at: F4
    eye: F4
    gain: F4
    """Factor from F to the share of the light that arrives along the azimuth."""
    facing: F4
    forwards: F4
    """The normal's components along the camera's ray and across it, n_e and n_h."""
    horizon: F4
    below: F4
    seen: F4
    """The height that the camera sees, in mm."""
    steepest: F4
    """The horizon's slope in that height, per mm along the longer side of a step."""


class Steps(NamedTuple):
    """The steps along an azimuth, N, as far as any cell of the frame goes."""

    across: np.float32
    down: np.float32
    """Direction of a step, in cells; the longer side is 1."""
    width: np.float32
    """Width of a cell in mm."""
    beyond: bool
    """Whether there is film beyond the frame."""
    length: Numbers
    """How many cells each step goes along its longer side."""
    rows: Numbers
    columns: Numbers
    """The first row and column of the frame that go so far, and those after the last: N x 2."""
    below: Numbers
    right: Numbers
    """The two cells that a step ends between, N x 2; ..."""
    part: F4
    """... and where between them."""
    middle: Numbers
    """The cell half-way to the step before, down and right: N x 2."""
    longest: F4
    """Distance of the film's end from each cell of the frame: rows x columns, as `length`."""


def sights(cells: Cells, grid: Grid, camera: float, refraction: float) -> Iterator[Sight]:
    """Yield what cells see of one another, azimuth by azimuth.

    `camera` is 1 over the height of the pupil for which the cells form a grid, `refraction` is that
    of their coat.
    """
    from tactograph.nodes.light._sweep_loops import rise

    inside = slice(None), *grid.frame
    at, normal = cells.at[inside].copy(), cells.normal[inside]
    eye = np.stack(to_pupil(camera, *at))
    azimuths = MATT_AZIMUTHS if refraction == 1 else COATED_AZIMUTHS
    for number in range(azimuths):
        turn = 2 * math.pi * (number + 0.5) / azimuths
        on, steps = _looking(at, normal, eye, turn, azimuths, grid, camera)
        most = int(np.prod(np.diff(steps.rows) * np.diff(steps.columns), axis=1).sum())
        # Room for every cell at every step, but hardly any of it is touched.
        share, direction = np.empty(most, np.float32), np.empty((3, most), np.float32)
        here, there = np.empty(most, np.intp), np.empty(most, np.intp)
        given = on, steps, cells.at[2], grid.rim, np.float32(camera)
        end = rise(*given, share, direction, here, there)
        if end:
            parts = share[:end].copy(), direction[:, :end].copy()
            yield Sight(*parts, here[:end].copy(), there[:end].copy())


def _looking(
    at: F4, normal: F4, eye: F4, turn: float, azimuths: int, grid: Grid, camera: float
) -> tuple[Looking, Steps]:
    """Return the start of a sweep, when the horizon of each cell is its own tangent."""
    x, y = math.cos(turn), math.sin(turn)
    facing = np.maximum((normal * eye).sum(0), LEAST_FACING)
    along = np.float32(x) * eye[0] + np.float32(y) * eye[1]
    flat = 1 - along * along  # the square of the azimuth's component across the camera's ray
    forwards = np.float32(x) * normal[0] + np.float32(y) * normal[1] - facing * along
    forwards = forwards / np.sqrt(flat)
    horizon = -forwards / facing
    longer = max(abs(x), abs(y))
    # The image of the tangent.
    nearer = 1 - np.float32(camera) * at[2]
    away = np.float32(camera * x) * at[0] + np.float32(camera * y) * at[1]
    widens = nearer * flat - away * along * eye[2]
    steepest = np.float32(1 / longer) * eye[2] / widens * (horizon * np.sqrt(flat) - along)
    azimuth = x / longer, y / longer
    on = Looking(
        at,
        eye,
        np.float32(2 / azimuths) * eye[2] / flat,
        facing,
        forwards,
        horizon,
        gathered(horizon, forwards, facing),
        at[2] / nearer,
        steepest,
    )
    return on, _steps(grid, azimuth)


def arriving(seen: Iterable[Sight], law: Law, lights: int, grid: Grid) -> F4:
    """Return what arrives at the cells of the frame, over pi: K x rows x columns."""
    total = np.zeros((lights, grid.rows * grid.columns), np.float32)
    for share, direction, here, there in seen:
        thrown = share * law(here, direction, there)
        for plane, found in zip(total, thrown, strict=True):
            plane += np.bincount(here, found, plane.size)
    return total.reshape(-1, grid.rows, grid.columns)


def matt(sources: F4) -> Law:
    """Cells of a matt film, K x rows x columns, throw the same in all directions."""
    flat = sources.reshape(len(sources), -1)
    return lambda here, direction, there: flat[:, there]


def gathered(t: F4, across: F4, facing: F4) -> F4:
    """F of equation B1."""
    part = t / (1 + t * t)
    half = np.float32(0.5)
    return np.asarray(half * across * (np.arctan(t) + part) + half * facing * t * part)


def _longest(grid: Grid, azimuth: tuple[float, float]) -> F4:
    """Return how far each cell of the frame is from the film's end."""
    ways = []
    for part, count in zip(azimuth, (grid.columns, grid.rows), strict=True):
        place = np.arange(count, dtype=np.float32)
        last = np.float32(grid.film - 0.5 + (count if part > 0 else 0))
        ways.append((last - place if part > 0 else last + 1 + place) / np.float32(abs(part)))
    across, down = ways
    return np.minimum(across, down[:, None])


@lru_cache(maxsize=256)
def _steps(grid: Grid, azimuth: tuple[float, float]) -> Steps:
    """Return the steps along an azimuth, which grow with the distance from the start.

    Cached: films change from touch to touch and from fit to fit, cells and azimuths do not.
    """
    across, down = azimuth
    rows, columns, ends = [], [], [0, 1]
    while True:
        row = _reaching(down * ends[-2], grid.rows, grid.film)
        column = _reaching(across * ends[-2], grid.columns, grid.film)
        if not row or not column:
            break
        rows.append((row.start, row.stop))
        columns.append((column.start, column.stop))
        ends.append(ends[-1] + min(max(1, ends[-1] // GROWTH), LONGEST))
    before, length = np.array(ends[:-2]), np.array(ends[1:-1])
    dy, dx = down * length, across * length
    below, right = (np.stack([np.floor(d), np.ceil(d)], axis=1) for d in (dy, dx))
    return Steps(
        np.float32(across),
        np.float32(down),
        np.float32(grid.width),
        grid.film > 0,
        length.astype(np.intp),
        np.array(rows, np.intp),
        np.array(columns, np.intp),
        below.astype(np.intp),
        right.astype(np.intp),
        # One of dx and dy is whole; along the other one the step ends between two cells.
        np.maximum(dy - below[:, 0], dx - right[:, 0]).astype(np.float32),
        np.rint(np.outer(before + length, (down, across)) / 2).astype(np.intp),
        _longest(grid, azimuth),
    )


def _reaching(far: float, count: int, film: float) -> range:
    """Return the cells of an axis that are still on the film after going `far` cells."""
    first = max(0, math.ceil(-0.5 - film - far))
    return range(first, min(count, math.floor(count - 0.5 + film - far) + 1))
