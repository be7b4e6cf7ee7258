"""Light between the cells of a film: a sweep over azimuths with a rising horizon.

The half-space above a cell at P is cut into half-planes that contain the camera's ray at P.
The sweep visits the film in such a plane in growing steps.  A place that raises the horizon from
t_0 to t_1, in t = tan(elevation), throws light on P::

    B(P) = albedo / pi sum L(P, Q) [F(t_1) - F(t_0)] dphi,
    F(t) = n_h / 2 (atan t + t / (1 + t^2)) + n_e / 2 t^2 / (1 + t^2)                         (B1)

with n_e and n_h the normal's components along the ray and perpendicular to it, in the plane, and F
the integral of cosine times solid angle.  The first horizon is the film's tangent, so a convex
film does not light itself, and film that nearer film hides throws no light (horizons: N. Max,
"Horizon mapping", 1988).
The camera sees such a half-plane as a line of its image, with places in the same order.
``kernels/headers/sweep.clh`` is the same.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.graph.cores import cores
from tactograph.nodes import F4
from tactograph.nodes.optics.film import to_pupil
from tactograph.nodes.optics.radiosity import Cells, Grid

STEP_GROWTH_CELLS = 6
"""Distance in cells per which a step grows by one cell."""
MAX_STEP_CELLS = 8
"""Longest step in cells."""
MIN_FACING = np.float32(1e-3)
"""Lower bound on n_e."""
MIN_APPARENT_RISE = np.float32(0.02)
"""Smallest rise above a cell's tangent that counts: film below it sends a ten-thousandth of its
light, and on film at rest noise makes many places rise a little."""

Numbers = NDArray[np.intp]
Law = Callable[[Numbers, F4, Numbers], F4]
"""Law of light between N pairs of cells: from the numbers of the frame's cells, directions 3 x N,
and the numbers of the other cells (among all cells) to light K x N."""


class _Steps(NamedTuple):
    """The N steps along an azimuth."""

    across: np.float32
    down: np.float32
    """Direction of a step, in cells; the longer side is 1."""
    length: Numbers
    """Length of each step along its longer side, in cells."""
    corners: Numbers
    """The two cells between which a step ends, down and right of the start: N x 2 x 2."""
    part: F4
    """Where the step ends between them, 0 to 1."""
    middle: Numbers
    """The cell half-way to the previous step, down and right: N x 2."""
    longest: F4
    """Distance of the film's end from each cell of the frame: rows x columns, as `length`."""


class _Looking(NamedTuple):
    """The frame's cells as they look along an azimuth: planes of rows x columns."""

    at: F4
    eye: F4
    facing: F4
    forwards: F4
    """The normal's components along the camera's ray and across it, n_e and n_h."""
    tangent: F4
    """The first horizon, t_0."""
    steepness: F4
    """Apparent rise per length of a line `MIN_APPARENT_RISE` above the tangent."""
    gain: F4
    """Factor from F to the share of the light that arrives, per radian of azimuth."""


def steps_in_table(grid: Grid) -> NDArray[np.int32]:
    """Return a kernel's steps along the azimuths: azimuths x steps x 7.

    They are the offsets of the two corners and of the middle, as numbers of cells; the length; and
    the bits of the part, and of the azimuth's x and y.
    """
    azimuths = _azimuths(grid.azimuths)
    ways, to_row = [_steps(grid, *azimuth) for azimuth in azimuths], (grid.whole[1], 1)
    table = np.zeros((len(ways), max(way.length.size for way in ways), 7), np.int32)
    for steps, way in zip(table, ways, strict=True):
        places = way.corners @ to_row, way.middle @ to_row, way.length, way.part.view(np.int32)
        steps[: way.length.size, :5] = np.column_stack(places)
    table[..., 5:] = azimuths.view(np.int32)[:, None]
    return table


def _azimuths(count: int) -> F4:
    """Return x and y of the azimuths that cells look along: count x 2."""
    turn = 2 * np.pi * (np.arange(count) + 0.5) / count
    return np.stack([np.cos(turn), np.sin(turn)], axis=1).astype(np.float32)


def _looking(at: F4, normal: F4, azimuth: F4, camera: float) -> _Looking:
    """The start of a sweep, when the horizon of each cell is its own tangent."""
    eye = np.stack(to_pupil(camera, *at))
    x, y = (np.float32(part) for part in azimuth)
    facing = np.maximum((normal * eye).sum(0), MIN_FACING)
    along = x * eye[0] + y * eye[1]
    flat = 1 - along * along  # the square of the azimuth's component across the camera's ray
    forwards = (x * normal[0] + y * normal[1] - facing * along) / np.sqrt(flat)
    tangent = -forwards / facing
    nearer = 1 - np.float32(camera) * at[2]
    widens = nearer * flat - np.float32(camera) * (x * at[0] + y * at[1]) * along * eye[2]
    lifted = (tangent + MIN_APPARENT_RISE) * np.sqrt(flat) - along
    steepness = eye[2] / widens * lifted / max(abs(x), abs(y))
    return _Looking(at, eye, facing, forwards, tangent, steepness, eye[2] / flat)


def _sight(
    on: _Looking, grid: Grid, steps: _Steps, camera: np.float32
) -> tuple[F4, F4, Numbers, Numbers]:
    """Return the N pairs of cells that see one another along an azimuth.

    Each pair has the factor from the other cell's light to the arriving light, per radian of
    azimuth; the direction to the other cell (3 x N); the number of the frame's cell; and the number
    of the other cell among all cells.

    The camera sees other heights, but straight lines stay straight: film that rises over the
    horizon in its image also does so in space.  Most steps see no film rise, and testing that in
    the image is faster.
    """
    step, cell, far, apparent = _risen(on, grid, steps, camera)
    (px, py, pz), eye = on.at.reshape(3, -1)[:, cell], on.eye.reshape(3, -1)[:, cell]
    # Measured from where the camera's ray through P meets the film at rest, and scaled by the
    # apparent width of the other cell; directions and tangents do not depend on that scale.
    whole, wider = 1 - camera * pz, 1 + camera * apparent
    x = px / whole + steps.across * far - px * wider
    y = py / whole + steps.down * far - py * wider
    z = apparent - pz * wider
    up = x * eye[0] + y * eye[1] + z * eye[2]
    aside = np.sqrt(x * x + y * y + z * z - up * up)
    t = up / aside
    tangent, forwards, facing = (
        plane.ravel()[cell] for plane in (on.tangent, on.forwards, on.facing)
    )
    # A cell's pairs are in order: each rises over the previous one, the first over the tangent.
    follows = np.diff(cell, prepend=-1) == 0
    before = np.where(follows, np.roll(t, 1), tangent)
    share = gathered(t, forwards, facing) - gathered(before, forwards, facing)
    half = (t + before) / 2
    direction = ((np.stack([x, y, z]) - up * eye) / aside + half * eye) / np.sqrt(1 + half * half)
    row, column = np.divmod(cell, grid.columns)
    down, right = steps.middle[step].T + grid.rim
    source = (row + down) * grid.whole[1] + column + right
    return on.gain.ravel()[cell] * share, direction, cell, source


def _risen(
    on: _Looking, grid: Grid, steps: _Steps, camera: np.float32
) -> tuple[Numbers, Numbers, F4, F4]:
    """Film that rises over the horizons in the image: number of the step, number of the cell,
    distance, and height as the camera sees it.

    Sorted by cell, and for each cell from near to far.
    """
    rows, columns = steps.longest.shape
    reach = int(steps.length[-1]) + 1
    apparent = on.at[2] / (1 - camera * on.at[2])
    film = np.pad(apparent, reach)
    horizon, cells, heights = on.steepness, [], []
    for length, corners, part in zip(steps.length, steps.corners, steps.part, strict=True):
        one, other = (
            film[reach + down : reach + down + rows, reach + right : reach + right + columns]
            for down, right in corners
        )
        ends = steps.longest < length
        z = np.where(ends, 0, one + part * (other - one))
        far = np.minimum(steps.longest, np.float32(length)) * np.float32(grid.width)
        steep = (z - apparent) / far
        if grid.film == 0:
            steep[ends] = -np.inf
        cells.append(np.flatnonzero(steep > horizon))
        heights.append(z.ravel()[cells[-1]])
        horizon = np.maximum(horizon, steep)
    cell, step = np.concatenate(cells), np.repeat(np.arange(len(cells)), [c.size for c in cells])
    order = np.argsort(cell, kind="stable")
    cell, step = cell[order], step[order]
    far = np.minimum(steps.longest.ravel()[cell], steps.length.astype(np.float32)[step])
    return step, cell, far * np.float32(grid.width), np.concatenate(heights)[order]


def arriving(cells: Cells, grid: Grid, camera: float, law: Law) -> F4:
    """Return the light that arrives at the cells of the frame, over pi: K x rows x columns.

    `camera` is 1 over the height of the pupil for which the cells form a grid.  All cores share
    the azimuths.
    """
    size, frame = grid.rows * grid.columns, (slice(None), *grid.frame)

    def along(azimuth: F4) -> NDArray[np.float64]:
        on = _looking(cells.at[frame], cells.normal[frame], azimuth, camera)
        steps = _steps(grid, *azimuth)
        share, direction, cell, source = _sight(on, grid, steps, np.float32(camera))
        thrown = share * law(cell, direction, source)
        return np.stack([np.bincount(cell, plane, size) for plane in thrown])

    with ThreadPoolExecutor(cores()) as threads:
        total: Any = sum(threads.map(along, _azimuths(grid.azimuths)))
    return (2 / grid.azimuths * total).astype(np.float32).reshape(-1, grid.rows, grid.columns)


def matt(sources: F4) -> Law:
    """The law of a matt film: cells, K x rows x columns, throw the same light in all directions."""
    flat = sources.reshape(len(sources), -1)
    return lambda cell, direction, source: flat[:, source]


def gathered(t: F4, across: F4, facing: F4) -> F4:
    """F of equation B1."""
    part = t / (1 + t * t)
    half = np.float32(0.5)
    return np.asarray(half * across * (np.arctan(t) + part) + half * facing * t * part)


def _longest(grid: Grid, azimuth: tuple[float, float]) -> F4:
    """Return the distance of each cell of the frame from the film's end."""
    ways = []
    for part, count in zip(azimuth, (grid.columns, grid.rows), strict=True):
        place = np.arange(count, dtype=np.float32)
        last = np.float32(grid.film - 0.5 + (count if part > 0 else 0))
        ways.append((last - place if part > 0 else last + 1 + place) / np.float32(abs(part)))
    across, down = ways
    return np.minimum(across, down[:, None])


@lru_cache(maxsize=256)
def _steps(grid: Grid, x: float, y: float) -> _Steps:
    """Return the steps along an azimuth, which grow with the distance from the start.

    Cached: films change from touch to touch and from fit to fit, cells and azimuths do not.
    """
    across, down = x / max(abs(x), abs(y)), y / max(abs(x), abs(y))
    longest = _longest(grid, (across, down))
    ends = [0, 1]
    while ends[-2] <= longest.max():
        ends.append(ends[-1] + min(max(1, ends[-1] // STEP_GROWTH_CELLS), MAX_STEP_CELLS))
    before, length = np.array(ends[:-2]), np.array(ends[1:-1])
    way = np.outer(length, (down, across))
    corners = np.stack([np.floor(way), np.ceil(way)], axis=1).astype(np.intp)
    return _Steps(
        np.float32(across),
        np.float32(down),
        length,
        corners,
        # One component of a step is an integer; along the other the step ends between two cells.
        (way - corners[:, 0]).max(axis=1).astype(np.float32),
        np.rint(np.outer(before + length, (down, across)) / 2).astype(np.intp),
        longest,
    )
