"""What the cells of a film throw on one another: a sweep over azimuths with a rising horizon.

The half-space above a cell at P is cut into half-planes that hold the camera's ray at P.
The film in such a plane is met in steps that grow; where a place rises above the horizon of those
before it, t = tan(elevation) from t_0 to t_1, it throws on P::

    B(P) = albedo / pi sum L(P, Q) [F(t_1) - F(t_0)] dphi,
    F(t) = n_h / 2 (atan t + t / (1 + t^2)) + n_e / 2 t^2 / (1 + t^2)                         (B1)

with n_e and n_h the normal's parts along the ray and across it, in the plane, and F the integral
of cosine and solid angle.  The first horizon is the film's own tangent, so a convex film
lights itself nowhere, and what hides behind nearer film throws nothing (horizons: Max 1988).
A camera that sees P sees whatever rises from its ray in order, near or far away, so a line of its
image is such a plane.  ``kernels/headers/sweep.clh`` holds the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4
from tactograph.nodes.light._film import to_pupil
from tactograph.nodes.light._radiosity import Cells, Grid

MATT_AZIMUTHS, COATED_AZIMUTHS = 16, 32
"""What a coat mirrors is narrower than the light of matt film."""
GROWTH = 8
"""Steps of the way after which a step is one cell longer, ..."""
LONGEST = 8
"""... and the longest step."""
LEAST_FACING = np.float32(1e-3)
"""Smallest n_e."""


Law = Callable[[NDArray[np.intp], F4, NDArray[np.intp]], F4]
"""How cells throw light on one another: on N of the frame's cells, by number, in directions, 3 x N,
from N of all cells; K x N."""


class Sight(NamedTuple):
    """What the cells of the frame see along an azimuth: N pairs of cells, by number."""

    share: F4
    """Of the light that arrives, N."""
    direction: F4
    """To the other cell, 3 x N."""
    here: NDArray[np.intp]
    there: NDArray[np.intp]
    """Among all cells."""


class _Looking(NamedTuple):
    """The cells of the frame, as one azimuth sees them; the horizon and F there rise.

    Seen by the camera, the film has other heights, but straight lines stay straight: what rises
    over the horizon there does so here.  Most steps see nothing rise, and that is known by less.
    """

    at: F4
    eye: F4
    step: tuple[float, float]
    """In cells; its longer side is 1."""
    flat: F4
    """The square of the azimuth's part across the camera's ray."""
    facing: F4
    across: F4
    longest: F4
    """Steps to where the film ends."""
    horizon: F4
    below: F4
    seen: F4
    """The height that the camera sees, in mm."""
    steepest: F4
    """Of it, where the horizon is: per mm along the longer side of a step."""


def sights(cells: Cells, grid: Grid, camera: float, refraction: float) -> Iterator[Sight]:
    """Yield what cells see of one another, azimuth by azimuth.

    `camera` is 1 over the height of the pupil that lines up the cells, `refraction` their coat's.
    """
    inside = slice(None), *grid.frame
    at, normal = cells.at[inside], cells.normal[inside]
    eye = np.stack(to_pupil(camera, *at))
    azimuths = MATT_AZIMUTHS if refraction == 1 else COATED_AZIMUTHS
    for number in range(azimuths):
        turn = 2 * math.pi * (number + 0.5) / azimuths
        on = _looking(at, normal, eye, (math.cos(turn), math.sin(turn)), grid, camera)
        risen = list(_risen(on, cells.at[2], grid, camera))
        if risen:
            share, direction, here, there = (
                np.concatenate(part, axis=-1) for part in zip(*risen, strict=True)
            )
            gain = np.float32(2 / azimuths) * eye[2].ravel()[here] / on.flat.ravel()[here]
            yield Sight(gain * share, direction, here, there)


def _looking(
    at: F4, normal: F4, eye: F4, azimuth: tuple[float, float], grid: Grid, camera: float
) -> _Looking:
    """Return what the cells of the frame see before anything rises: their own tangents."""
    x, y = azimuth
    facing = np.maximum((normal * eye).sum(0), LEAST_FACING)
    along = np.float32(x) * eye[0] + np.float32(y) * eye[1]
    flat = 1 - along * along
    forwards = np.float32(x) * normal[0] + np.float32(y) * normal[1] - facing * along
    across = forwards / np.sqrt(flat)
    horizon = -across / facing
    longer = max(abs(x), abs(y))
    step = x / longer, y / longer
    # The image of the tangent.
    nearer = 1 - np.float32(camera) * at[2]
    away = np.float32(camera * x) * at[0] + np.float32(camera * y) * at[1]
    widens = nearer * flat - away * along * eye[2]
    steepest = np.float32(1 / longer) * eye[2] / widens * (horizon * np.sqrt(flat) - along)
    return _Looking(
        at,
        eye,
        step,
        flat,
        facing,
        across,
        _longest(grid, step),
        horizon,
        gathered(horizon, across, facing),
        at[2] / nearer,
        steepest,
    )


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


def _longest(grid: Grid, step: tuple[float, ...]) -> F4:
    """Return how many steps each cell of the frame is from the film's end."""
    ways = []
    for part, count in zip(step, (grid.columns, grid.rows), strict=True):
        place = np.arange(count, dtype=np.float32)
        last = np.float32(grid.film - 0.5 + (count if part > 0 else 0))
        ways.append((last - place if part > 0 else last + 1 + place) / np.float32(abs(part)))
    across, down = ways
    return np.minimum(across, down[:, None])


def _risen(
    on: _Looking, rises: F4, grid: Grid, camera: float
) -> Iterator[tuple[F4, F4, NDArray[np.intp], NDArray[np.intp]]]:
    """Yield, step by step, what has risen over the horizon.

    Its share of F, the direction of its middle, the numbers of the frame's cells that see it, and
    of the cells half-way to the step before.
    """
    by, (across, down) = np.float32(camera), on.step
    last, step = 0, 1
    while True:
        rows = _reaching(down * last, grid.rows, grid.film)
        columns = _reaching(across * last, grid.columns, grid.film)
        if not rows or not columns:
            return
        here = slice(rows.start, rows.stop), slice(columns.start, columns.stop)
        longest = on.longest[here]
        ends = longest < step
        far = np.minimum(longest, np.float32(step)) * np.float32(grid.width)
        z = np.where(ends, 0, _between(rises, here, across * step, down * step, grid.rim))
        seen = z / (1 - by * z) if camera else z
        higher = seen - on.seen[here] > on.steepest[here] * far
        row, column = np.nonzero(higher if grid.film else higher & ~ends)
        if len(row):
            chosen = row + rows.start, column + columns.start
            below, right = (grid.rim + round(part * (last + step) / 2) for part in (down, across))
            there = (chosen[0] + below) * grid.whole[1] + chosen[1] + right
            met = far[row, column], z[row, column]
            on.steepest[chosen] = (seen[row, column] - on.seen[chosen]) / met[0]
            seeing = chosen[0] * grid.columns + chosen[1]
            yield *_share(on, met, chosen, by), seeing, there
        last, step = step, step + min(max(1, step // GROWTH), LONGEST)


def _share(
    on: _Looking,
    met: tuple[F4, F4],
    chosen: tuple[NDArray[np.intp], ...],
    by: np.float32,
) -> tuple[F4, F4]:
    """Raise the horizon of those `chosen`; return their shares of F and directions, 3 x N.

    `met` is how far along the longer side of a step, in mm, film of what height rises.
    """
    (rows, columns), (far, z), (across, down) = chosen, met, on.step
    (px, py, pz), eye = on.at[:, rows, columns], on.eye[:, rows, columns]
    # From where the camera's ray of P meets the film at rest.
    whole, nearer = 1 - by * pz, 1 - by * z
    x = (px / whole + np.float32(across) * far) * nearer - px
    y = (py / whole + np.float32(down) * far) * nearer - py
    z = z - pz
    up = x * eye[0] + y * eye[1] + z * eye[2]
    aside = np.sqrt(x * x + y * y + z * z - up * up)
    level = (np.stack([x, y, z]) - up * eye) / aside
    t: F4 = np.asarray(up / aside, np.float32)
    half = (t + on.horizon[chosen]) / 2
    higher = gathered(t, on.across[chosen], on.facing[chosen])
    share = higher - on.below[chosen]
    on.horizon[chosen], on.below[chosen] = t, higher
    return share, np.asarray((level + half * eye) / np.sqrt(1 + half * half), np.float32)


def _reaching(far: float, count: int, film: float) -> range:
    """Return which cells of an axis lie on the film if they go so far."""
    first = max(0, math.ceil(-0.5 - film - far))
    return range(first, min(count, math.floor(count - 0.5 + film - far) + 1))


def _between(rises: F4, here: tuple[slice, slice], dx: float, dy: float, rim: int) -> F4:
    """Return `rises`, which has `rim` cells more on all sides, so far from what lies `here`.

    One of dx and dy is whole; along the other one it lies between two cells.
    """
    below, right = math.floor(dy), math.floor(dx)
    one, other = (
        rises[tuple(slice(s.start + rim + d, s.stop + rim + d) for s, d in pairs)]
        for pairs in (
            zip(here, (below, right), strict=True),
            zip(here, (math.ceil(dy), math.ceil(dx)), strict=True),
        )
    )
    return one + np.float32(max(dy - below, dx - right)) * (other - one)
