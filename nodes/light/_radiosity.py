"""Cells of a film that light one another: what `film_bounce` and `interreflect` share.

``kernels/headers/radiosity.clh`` holds the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4
from tactograph.nodes.light._cache_blocks import in_blocks

MOST_RIM_CELLS = 4
"""The film beyond the frame is far from most cells: this many cells across say enough."""
BLOCK, SPAN = 4, 16
"""Cells of a block's side, as which film far away counts; cells of a row that share what is near,
as many as the lanes of a kernel."""
LEAST = np.float32(0.1)
"""Smallest denominator: beyond it the camera sees the film from behind."""
NEAREST = np.float32(1e-12)
"""mm2, keeps a cell's distance from itself from being zero; its light on itself is zero anyway."""


class Grid(NamedTuple):
    """Cells of `factor` x `factor` pixels, rows x columns of them, `rim` cells all around."""

    factor: int
    rows: int
    columns: int
    rim: int
    rim_mm: float
    """Width of a cell of the rim."""

    @property
    def whole(self) -> tuple[int, int]:
        """The cells of the frame and of the rim."""
        return self.rows + 2 * self.rim, self.columns + 2 * self.rim


def cell_grid(size: tuple[int, ...], pixel: float, most: int, rim_mm: float) -> Grid:
    """The finest cells of which there are at most so many in the frame."""
    factor = max(1, math.isqrt(math.prod(size) // most))
    while math.prod(-(-side // factor) for side in size) > most:
        factor += 1
    rows, columns = (-(-side // factor) for side in size)
    rim = min(math.ceil(rim_mm / (factor * pixel)), MOST_RIM_CELLS)
    return Grid(factor, rows, columns, rim, rim_mm / max(rim, 1))


def framed(grid: Grid) -> NDArray[np.intp]:
    """The cells of the frame among all."""
    rows, columns = grid.whole
    numbers = np.arange(rows * columns).reshape(rows, columns)
    inside = slice(grid.rim, rows - grid.rim), slice(grid.rim, columns - grid.rim)
    return numbers[inside].ravel()


def cells_of(
    height: F4,
    lights: F4,
    pixel: np.float32,
    grid: Grid,
    slope: F4 | None = None,
    camera: float = 0.0,
) -> tuple[F4, F4, F4]:
    """Return N x 3 middles, N x 3 area vectors and K x N irradiances of the film at rest.

    `height` is the one that the camera sees (`view_slope`), the rest what the film has in mm.
    The irradiance is that of the film at rest that the same pixels see.
    Without `slope` (2 x H x W), which is the film's, the height's own differences tell it.
    """
    u, across = _sides(height.shape[1], pixel, grid)
    v, down = _sides(height.shape[0], pixel, grid)
    v, by = v[:, None], np.float32(camera)
    seen, p, q = (np.pad(part, grid.rim) for part in _tilts(height, slope, pixel, grid.factor))
    if slope is None:
        steep = np.maximum(1 + by * (seen - (p * u + q * v)), LEAST)
        p, q = p / steep, q / steep
    nearer: F4 = np.float32(1) / (np.float32(1) + by * seen)
    x, y = u * nearer, v * nearer
    area = down[:, None] * across * nearer**2 / np.maximum(1 + by * (p * u + q * v), LEAST)
    places = np.stack([x, y, seen * nearer], -1)
    areas: F4 = np.asarray(np.stack([-p * area, -q * area, area], -1), np.float32)
    rest = np.empty((len(lights), *seen.shape), np.float32)
    for found, (lx, ly, lz) in zip(rest, lights, strict=True):
        dx, dy = lx - u, ly - v
        square = lz * lz / (dx * dx + dy * dy + lz * lz)
        np.multiply(square, np.sqrt(square), out=found)
    return places.reshape(-1, 3), areas.reshape(-1, 3), rest.reshape(len(lights), -1)


def _sides(count: int, pixel: np.float32, grid: Grid) -> tuple[F4, F4]:
    """Return the cells' x, or y, and their widths in mm, those of the rim at both ends."""
    first = np.arange(0, count, grid.factor)
    pixels = np.minimum(grid.factor, count - first).astype(np.float32)
    half = np.float32(0.5)
    middle = (first.astype(np.float32) + half * pixels - half * np.float32(count)) * pixel
    rim = np.float32(grid.rim_mm)
    beyond = half * np.float32(count) * pixel + (np.arange(grid.rim, dtype=np.float32) + half) * rim
    wide = np.full(grid.rim, rim, np.float32)
    return (
        np.concatenate([-beyond[::-1], middle, beyond]),
        np.concatenate([wide, pixels * pixel, wide]),
    )


def _tilts(height: F4, slope: F4 | None, pixel: np.float32, factor: int) -> F4:
    """Return the cells' mean height and mean slopes p and q, 3 x rows x columns."""
    if slope is None:
        p, q = _difference(height, 1) / pixel, _difference(height, 0) / pixel
    else:
        p, q = slope
    return means(np.stack([height, p, q]), factor)


def _difference(z: F4, axis: int) -> F4:
    """Central difference along `axis`, one-sided at the ends, 0 for one pixel."""
    here = np.arange(z.shape[axis])
    before, after = np.maximum(here - 1, 0), np.minimum(here + 1, here[-1])
    span = np.maximum(after - before, 1).astype(np.float32)
    return (z.take(after, axis) - z.take(before, axis)) / (span if axis else span[:, None])


def means(planes: F4, factor: int) -> F4:
    """Return the mean of each cell; the last ones may have fewer pixels."""
    sums = planes
    for axis in (1, 2):
        first = np.arange(0, planes.shape[axis], factor)
        sums = np.add.reduceat(sums, first, axis)
        pixels = np.minimum(factor, planes.shape[axis] - first).astype(np.float32)
        sums = sums / (pixels if axis == 2 else pixels[:, None])
    return sums


Arriving = Callable[[F4, F4, F4, F4, F4], F4]
"""What N sources (places, area vectors, light) throw on M places with normals: K x M."""


def matt_arriving(at: F4, normal: F4, places: F4, areas: F4, sources: F4) -> F4:
    """Return what N sources throw on M places with normals of any length: K x M."""
    dx, dy, dz = (there - here[:, None] for there, here in zip(places, at, strict=True))
    square = dx * dx + dy * dy + dz * dz + NEAREST
    nx, ny, nz = (normal / np.sqrt((normal * normal).sum(axis=0)))[..., None]
    sx, sy, sz = areas
    arriving = np.maximum(nx * dx + ny * dy + nz * dz, np.float32(0))
    leaving = np.maximum(-(sx * dx + sy * dy + sz * dz), np.float32(0))
    return np.asarray(sources @ (arriving * leaving / (square * square)).T)


def all_on_all(
    places: F4,
    areas: F4,
    sources: F4,
    targets: NDArray[np.intp],
    arriving: Arriving = matt_arriving,
) -> F4:
    """Return what all cells throw on those of the frame: K x cells, without albedo / pi."""
    at, normal = places.T.copy(), areas.T.copy()

    def on(block: slice) -> F4:
        here = targets[block]
        return arriving(at[:, here], normal[:, here], at, normal, sources)

    return np.concatenate(in_blocks(on, len(targets), len(places)), axis=1)


def near_and_far(
    places: F4, areas: F4, sources: F4, grid: Grid, near: int, arriving: Arriving = matt_arriving
) -> F4:
    """Return what `all_on_all` does for the frame's cells, those far away put into blocks.

    SPAN cells side by side, and the block rows they lie in, see all cells at most `near` blocks
    away one by one.
    """
    blocks = _blocks(places, areas, sources, grid)
    inside = framed(grid)
    fine = [
        part[:, inside].reshape(-1, grid.rows, grid.columns)
        for part in (places.T, areas.T, sources)
    ]
    found = np.empty((len(sources), grid.rows, grid.columns), np.float32)
    for top in range(0, grid.rows, BLOCK):
        for left in range(0, grid.columns, SPAN):
            here = (slice(None), slice(top, top + BLOCK), slice(left, left + SPAN))
            at, normal = (part[here].reshape(3, -1) for part in fine[:2])
            around, far = _around(top, left, grid, near)
            near_by = [part[around].reshape(len(part), -1) for part in fine]
            shown = arriving(at, normal, *near_by)
            shown += arriving(at, normal, *(part[:, far] for part in blocks))
            found[here] = shown.reshape(found[here].shape)
    return found.reshape(len(sources), -1)


def _around(
    top: int, left: int, grid: Grid, near: int
) -> tuple[tuple[slice, ...], NDArray[np.bool_]]:
    """The frame's cells that count one by one, and the blocks that count as such."""
    edge = rim_blocks(grid.rim)
    counts = -(-grid.rows // BLOCK), -(-grid.columns // BLOCK)
    first = max(0, top // BLOCK - near), max(0, left // BLOCK - near)
    last = top // BLOCK + near + 1, (left + SPAN) // BLOCK + near
    spans = list(zip(first, last, counts, strict=True))
    far = np.ones([count + 2 * edge for count in counts], bool)
    far[tuple(slice(edge + a, edge + min(b, count)) for a, b, count in spans)] = False
    return (slice(None), *(slice(BLOCK * a, BLOCK * b) for a, b, _ in spans)), far


def rim_blocks(rim: int) -> int:
    """The blocks across the rim: the cell at the frame is one, those farther away another."""
    return min(rim, 2)


def _blocks(places: F4, areas: F4, sources: F4, grid: Grid) -> list[F4]:
    """Cells put together: mean place, whole area vector and mean light by area."""
    area = areas[:, 2]
    planes = np.concatenate([places.T * area, areas.T, sources * area]).reshape(-1, *grid.whole)
    for axis, cells in ((1, grid.rows), (2, grid.columns)):
        starts = np.arange(grid.rim, grid.rim + cells, BLOCK)
        end, edge = grid.rim + cells, rim_blocks(grid.rim)
        outside = [0, grid.rim - 1, end, end + 1]
        starts = np.array([*outside[2 - edge : 2], *starts, *outside[2 : 2 + edge]])
        planes = np.add.reduceat(planes, starts, axis)
    place, vector, light = planes[:3], planes[3:6], planes[6:]
    return [place / vector[2], vector, light / vector[2]]
