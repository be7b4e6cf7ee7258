"""The light that the film throws on itself: interreflection of a film that is no longer flat."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.graph import Close, InputError, node
from tactograph.nodes import F4, Albedo, Height, Light, LightPositions, PixelSize
from tactograph.nodes.light._blocks import in_blocks

if TYPE_CHECKING:
    from tactograph.graph.backends.launch import Launch

MOST_RIM_CELLS = 4
"""The film beyond the frame is far from most cells: this many cells across say enough."""
MOST_ALBEDO = 0.95
NEAREST = np.float32(1e-12)
"""mm2, keeps a cell's distance from itself from being zero; its light on itself is zero anyway."""


class _Grid(NamedTuple):
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


@node(
    neutral=0.0,
    tolerance=Close(1e-5, 2e-4, why="sums over all cells, in another order"),
)
def film_bounce(
    light: Light,
    height: Height,
    lights: LightPositions,
    pixel: PixelSize,
    albedo: Albedo,
    before: Light | None = None,
    *,
    cells: Annotated[int, Interval(ge=1, le=20000)] = 1200,
    rim_mm: Annotated[float, Interval(ge=0, le=50)] = 2.0,
    share: Annotated[float, Interval(gt=0, le=1)] = 0.5,
) -> Light:
    r"""Return the part of the light that comes from other places of the film.

    A cell of the film that reflects `albedo` of the light E_j that falls on it lights another
    one.  The camera sees all the light of a cell, that of earlier bounces too, so that one sum
    over the cells holds all bounces::

        B(P) = albedo sum_j max(n.d, 0) max(-S_j.d, 0) / (pi |d|^4) E_j,    d = P_j - P

    with n the normal at P and S_j the area vector of cell j (radiosity; Nayar, Ikeuchi and
    Kanade 1991).  E_j is the light relative to the film at rest times the irradiance of the
    film at rest, which falls off with the inverse square and the cosine.  The result is
    relative to the film at rest again; taken off `light`, it leaves what comes from the LED.
    A flat film lights itself nowhere.  Cells do not hide one another.

    Parameters
    ----------
    light
        K x H x W, as seen, 1 on the film at rest.
    height
        H x W, mm.
    lights
        K x 3, mm.
    pixel
        mm per px of `light` and `height`.
    albedo
        Share of the light that the film reflects, 0 to 0.95; with 0 the result is 0.
    before
        K x H x W, the result of the round before, where height and bounce are found in turns.
    cells
        Most cells; the sum grows with the square of their number.  They are squares of as many
        pixels as it takes, and the result is interpolated between them.
    rim_mm
        How far the film goes on beyond the frame, flat and at rest.
    share
        By how much of the way the result goes from `before` to what this round says: below 1
        it keeps the turns from swinging.

    Returns
    -------
    ndarray
        K x H x W.

    Raises
    ------
    InputError
        If the albedo is none.
    """
    _check(albedo)
    if albedo == 0:
        return np.zeros_like(light)
    grid = _grid(height.shape, pixel, cells, rim_mm)
    places, areas, rest = _cells(height, lights, np.float32(pixel), grid)
    sources = rest.copy()
    framed = _framed(grid)
    sources[:, framed] *= _means(light, grid.factor).reshape(len(light), -1)
    gain = np.float32(albedo) / np.float32(math.pi)
    bounced = gain * _all_on_all(places, areas, sources, framed) / rest[:, framed]
    planes = bounced.reshape(len(light), grid.rows, grid.columns)
    found = _interpolated(planes, height.shape, grid.factor)
    return found if before is None else before + np.float32(share) * (found - before)


@film_bounce.opencl()
def _launch(run: Launch) -> None:
    count, *size = (run.sizes[symbol] for symbol in "KHW")
    light, height, lights, pixel, albedo = (
        run.inputs[name] for name in ("light", "height", "lights", "pixel", "albedo")
    )
    settings, out, constants = run.settings, run.outputs["film_bounce"], {"LEDS": count}
    _check(albedo)
    if albedo == 0:
        work = run.in_lanes(count, *size)
        run.kernel("nothing", work, out, count * math.prod(size), constants=constants)
        return
    grid = _grid((size[0], size[1]), pixel, settings["cells"], settings["rim_mm"])
    table = run.scratch((6 + 2 * count, math.prod(grid.whole)))
    bounced = run.scratch((count, grid.rows, grid.columns))
    shape = grid.rows, grid.columns, grid.rim
    local = (run.group,)
    arguments = light, height, lights, pixel, table, *size, grid.factor, *shape, grid.rim_mm
    run.kernel("lay_out", (math.prod(grid.whole),), *arguments, local=local, constants=constants)
    work = run.in_row_lanes(grid.rows, grid.columns)
    gain = float(np.float32(albedo) / np.float32(math.pi))
    run.kernel("bounce", work, table, bounced, *shape, gain, local=local, constants=constants)
    work = run.in_row_lanes(count, *size)
    share = settings["share"]
    arguments = bounced, run.inputs.get("before"), out, *size, grid.factor, *shape[:2], share
    run.kernel("interpolate", work, *arguments, constants=constants)


@film_bounce.example
def _example(rng: np.random.Generator, K: int, **_: int) -> dict[str, Any]:
    """LEDs in front of the film."""
    sideways = rng.uniform(-20, 20, (K, 2))
    return {"lights": np.column_stack([sideways, rng.uniform(15, 40, K)]).astype(np.float32)}


def _check(albedo: float) -> None:
    if not 0 <= albedo <= MOST_ALBEDO:
        raise InputError(
            f"film_bounce: albedo is {albedo:g}; give the share of the light that the film "
            f"reflects, 0 to {MOST_ALBEDO:g}"
        )


def _grid(size: tuple[int, ...], pixel: float, most: int, rim_mm: float) -> _Grid:
    """The finest cells of which there are at most so many in the frame."""
    factor = max(1, math.isqrt(math.prod(size) // most))
    while math.prod(-(-side // factor) for side in size) > most:
        factor += 1
    rows, columns = (-(-side // factor) for side in size)
    rim = min(math.ceil(rim_mm / (factor * pixel)), MOST_RIM_CELLS)
    return _Grid(factor, rows, columns, rim, rim_mm / max(rim, 1))


def _framed(grid: _Grid) -> NDArray[np.intp]:
    """The cells of the frame among all."""
    rows, columns = grid.whole
    numbers = np.arange(rows * columns).reshape(rows, columns)
    inside = slice(grid.rim, rows - grid.rim), slice(grid.rim, columns - grid.rim)
    return numbers[inside].ravel()


def _cells(height: F4, lights: F4, pixel: np.float32, grid: _Grid) -> tuple[F4, F4, F4]:
    """Return N x 3 middles, N x 3 area vectors and K x N irradiances of the film at rest."""
    x, across = _sides(height.shape[1], pixel, grid)
    y, down = _sides(height.shape[0], pixel, grid)
    z, p, q = (np.pad(part, grid.rim) for part in _tilts(height, pixel, grid.factor))
    area = down[:, None] * across
    places = np.stack([np.broadcast_to(x, z.shape), np.broadcast_to(y[:, None], z.shape), z], -1)
    areas = np.stack([-p * area, -q * area, area], -1)
    rest = np.empty((len(lights), *z.shape), np.float32)
    for found, (lx, ly, lz) in zip(rest, lights, strict=True):
        dx, dy = lx - x, ly - y[:, None]
        nearer = lz * lz / (dx * dx + dy * dy + lz * lz)
        np.multiply(nearer, np.sqrt(nearer), out=found)
    return places.reshape(-1, 3), areas.reshape(-1, 3), rest.reshape(len(lights), -1)


def _sides(count: int, pixel: np.float32, grid: _Grid) -> tuple[F4, F4]:
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


def _tilts(height: F4, pixel: np.float32, factor: int) -> F4:
    """Return the cells' mean height and mean slopes p and q, 3 x rows x columns."""
    p, q = _difference(height, 1) / pixel, _difference(height, 0) / pixel
    return _means(np.stack([height, p, q]), factor)


def _difference(z: F4, axis: int) -> F4:
    """Central difference along `axis`, one-sided at the ends, 0 for one pixel."""
    here = np.arange(z.shape[axis])
    before, after = np.maximum(here - 1, 0), np.minimum(here + 1, here[-1])
    span = np.maximum(after - before, 1).astype(np.float32)
    return (z.take(after, axis) - z.take(before, axis)) / (span if axis else span[:, None])


def _means(planes: F4, factor: int) -> F4:
    """Return the mean of each cell; the last ones may have fewer pixels."""
    sums = planes
    for axis in (1, 2):
        first = np.arange(0, planes.shape[axis], factor)
        sums = np.add.reduceat(sums, first, axis)
        pixels = np.minimum(factor, planes.shape[axis] - first).astype(np.float32)
        sums = sums / (pixels if axis == 2 else pixels[:, None])
    return sums


def _all_on_all(places: F4, areas: F4, sources: F4, framed: NDArray[np.intp]) -> F4:
    """Return what all cells throw on those of the frame: K x cells, without albedo / pi."""
    sx, sy, sz = areas.T.copy()
    x, y, z = places.T.copy()
    normals = areas / np.sqrt((areas * areas).sum(axis=1, keepdims=True))
    light = np.ascontiguousarray(sources.T)

    def on(block: slice) -> F4:
        at = framed[block]
        dx, dy, dz = x - x[at, None], y - y[at, None], z - z[at, None]
        square = dx * dx + dy * dy + dz * dz + NEAREST
        nx, ny, nz = (part[:, None] for part in normals[at].T)
        arriving = np.maximum(nx * dx + ny * dy + nz * dz, np.float32(0))
        leaving = np.maximum(-(sx * dx + sy * dy + sz * dz), np.float32(0))
        return np.asarray((arriving * leaving / (square * square)) @ light)

    return np.concatenate(in_blocks(on, len(framed), len(x))).T


def _interpolated(planes: F4, size: tuple[int, ...], factor: int) -> F4:
    """Bring the values of cells to pixels."""
    if factor == 1:
        return planes
    above, below, down = _between(size[0], planes.shape[1], factor)
    left, right, across = _between(size[1], planes.shape[2], factor)
    wide = _mixed(planes[..., left], planes[..., right], across)
    return _mixed(wide[:, above], wide[:, below], down[:, None])


def _between(count: int, cells: int, factor: int) -> tuple[NDArray[np.intp], NDArray[np.intp], F4]:
    """The cells whose middles a pixel lies between, and how far from the first."""
    place = (np.arange(count, dtype=np.float32) + np.float32(0.5)) / np.float32(factor)
    place = np.clip(place - np.float32(0.5), np.float32(0), np.float32(cells - 1))
    first = place.astype(np.intp)
    return first, np.minimum(first + 1, cells - 1), place - first.astype(np.float32)


def _mixed(a: F4, b: F4, share: F4) -> F4:
    return a + (b - a) * share
