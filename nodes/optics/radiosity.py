"""Cells of a film that light one another, for `film_bounce`.

``kernels/headers/radiosity.clh`` is the same.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes.optics.between_cells import between_cells
from tactograph.nodes.optics.difference import difference
from tactograph.nodes.optics.near_light import MIN_VIEW_SHARE, irradiance_ratio
from tactograph.nodes.optics.normals import normals_of

MAX_RIM_CELLS = 64
"""Distance from the frame, in cells, beyond which the film's light is negligible."""
SWEEP_MARGIN_CELLS = 12
"""Cells beyond the film that a kernel's tile, or a step that overshoots, may read."""
COATED_AZIMUTHS = 32
"""Number of azimuths under a coat, whose mirrored light is narrower than a matt film's."""

MISSED_SHARE = 0.7
"""Light that cells still miss, as a share of their excess over cells twice as large.  It would
be a third if the error grew with the square of the side, and 1 if it grew with the side, as in a
sharp fold.  On pressed film, with cells of 2, 4 and 8 pixels, it was 0.69 to 0.81."""


class Grid(NamedTuple):
    """Cells of `factor` x `factor` pixels: rows x columns in the frame, `rim` more on each side.

    The last cells may have fewer pixels, but count as wide as all others.
    """

    factor: int
    rows: int
    columns: int
    rim: int
    width: float
    """Width of a cell in mm."""
    film: float
    """Extent of the film beyond the frame, in cells."""
    azimuths: int
    """Number of azimuths that the cells look along."""

    @property
    def whole(self) -> tuple[int, int]:
        """The number of rows and columns of cells, with the rim."""
        return self.rows + 2 * self.rim, self.columns + 2 * self.rim

    @property
    def frame(self) -> tuple[slice, slice]:
        """The slices that select the frame's cells among all."""
        return slice(self.rim, self.rim + self.rows), slice(self.rim, self.rim + self.columns)


class Cells(NamedTuple):
    """The film of each cell, as planes of all rows x columns."""

    at: F4
    """3 x, in mm, of the middles."""
    normal: F4
    """3 x, of length 1."""
    rest: F4
    """K x, the irradiance of the film at rest that the same pixels see."""


def cell_grid(
    size: tuple[int, ...],
    pixel: float,
    cells: int,
    rim_mm: float,
    refraction: float = 1.0,
    azimuths: int = COATED_AZIMUTHS,
) -> Grid:
    """Return the grid of about `cells` cells in the frame, by the nearest side in pixels.

    If sides were rounded up, cells of small frames would be up to twice as large, and the light in
    a fold, which the coat's fit depends on, would be wrong by up to a tenth.  Cells look along
    `azimuths` under a coat, and along half as many on a matt film: as many in each quadrant, or
    they would see more on one side.
    """
    factor = max(1, round(math.sqrt(math.prod(size) / cells)))
    rows, columns = (-(-side // factor) for side in size)
    width = factor * float(pixel)
    film = min(rim_mm / width, float(MAX_RIM_CELLS))
    count = azimuths if refraction != 1 else 4 * math.ceil(azimuths / 8)
    return Grid(factor, rows, columns, math.ceil(film) + SWEEP_MARGIN_CELLS, width, film, count)


def larger_cells(grid: Grid) -> Grid:
    """Return cells with sides twice as long, over the same film."""
    film = grid.film / 2
    return grid._replace(
        factor=2 * grid.factor,
        rows=-(-grid.rows // 2),
        columns=-(-grid.columns // 2),
        rim=math.ceil(film) + SWEEP_MARGIN_CELLS,
        width=2 * grid.width,
        film=film,
    )


def extrapolated(on_cells: Callable[[Grid], F4], grid: Grid) -> F4:
    """Return the result on cells, extrapolated by that on cells twice as large (Richardson)."""
    bounced, larger = on_cells(grid), on_cells(larger_cells(grid))
    return bounced + np.float32(MISSED_SHARE) * (
        bounced - between_cells(larger, bounced.shape[-2:], 2)
    )


def cells_of(
    height: F4,
    lights: F4,
    pixel: np.float32,
    grid: Grid,
    slope: F4 | None = None,
    camera: float = 0.0,
) -> Cells:
    """Return the cells of a film.

    `height` is the height that the camera sees (`view_slope`); the cells are those of the film, in
    mm.  Without the film's `slope` (2 x H x W), differences of the height replace it.
    """
    u, aside = _middles(height.shape[1], pixel, grid)
    v, below = _middles(height.shape[0], pixel, grid)
    v, below, by = v[:, None], below[:, None], np.float32(camera)
    changes = (difference(height, axis) / pixel for axis in (1, 0))
    mean_height, across, down = means(np.stack([height, *changes]), grid.factor)
    mean_height += aside * across + below * down
    p, q = (across, down) if slope is None else means(slope, grid.factor)
    mean_height, p, q = (np.pad(part, grid.rim) for part in (mean_height, p, q))
    if slope is None:
        steep = np.maximum(1 + by * (mean_height - (p * u + q * v)), MIN_VIEW_SHARE)
        p, q = p / steep, q / steep
    nearer: F4 = np.float32(1) / (np.float32(1) + by * mean_height)
    rest = np.empty((len(lights), *mean_height.shape), np.float32)
    for plane, (lx, ly, lz) in zip(rest, lights, strict=True):
        dx, dy = lx - u, ly - v
        plane[:] = irradiance_ratio(lz * lz, dx * dx + dy * dy + lz * lz)
    at = np.stack([u * nearer, v * nearer, mean_height * nearer])
    return Cells(at, normals_of((p, q)), rest)


def _middles(count: int, pixel: np.float32, grid: Grid) -> tuple[F4, F4]:
    """Return the cells' x (or y), and its offset from the mean of their pixels in the frame."""
    cells = -(-count // grid.factor)
    width, half = np.float32(grid.factor) * pixel, np.float32(0.5)
    number = np.arange(-grid.rim, cells + grid.rim, dtype=np.float32)
    pixels = np.minimum(grid.factor, count - grid.factor * np.arange(cells)).astype(np.float32)
    left = half * np.float32(count) * pixel
    return (number + half) * width - left, half * (grid.factor - pixels) * pixel


def means(planes: F4, factor: int) -> F4:
    """Return the mean of each cell; the last cells may have fewer pixels."""
    sums = planes
    for axis in (1, 2):
        first = np.arange(0, planes.shape[axis], factor)
        sums = np.add.reduceat(sums, first, axis)
        pixels = np.minimum(factor, planes.shape[axis] - first).astype(np.float32)
        sums = sums / (pixels if axis == 2 else pixels[:, None])
    return sums
