"""Look up the slope of the nearest light in the tables."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Annotated, Any, NamedTuple

import cv2
import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tactograph.graph import Flips, SizeLimit, node
from tactograph.graph.backends.launch import Launch
from tactograph.graph.run.cores import cores
from tactograph.nodes import F4, Labels, Light, Slope
from tactograph.nodes.slope.index_lut import LutIndex, index_lut

SPARE = 3
"""So many neighbours more are asked for, to settle ties in float32 as the kernel does."""
ALIKE = 1e-5
"""Distances that differ by less than this part may change places in float32."""
ROUNDING = 1e-6
"""Error of a distance between places in float32, relative to the largest coordinate."""
SINGLE_TREE, LEAF = 4, 8
"""FLANN's number for an exact tree, and entries in a leaf of it."""
UNLIMITED = {"checks": -1, "eps": 0.0, "sorted": True}
PARTS = 16
"""So many parts of the frame are shared out among the cores."""
MOST_LIGHT = 1e15
PIXELS_IN_CELL = 1024
"""So many pixels at least are in a cell of the sort, on average; the kernel's PIECE."""
MOST_LEVELS = 10
SAMPLES = 8
"""Pixels per cell that are sampled for the medians; the kernel's SAMPLES."""
SPARSER = 3
"""The cells of shadowed pixels are so many levels coarser; the kernel's SPARSER."""
F8 = NDArray[np.float64]
CHUNKS = 64
"""Work-items that share the frame's pixels."""


@node(
    tolerance=Flips(1e-3, 1e-6, 1e-6, why="ties between more neighbours than are compared"),
    sizes={"K": SizeLimit(3, 8, "the tables are for 3 to 8 LEDs")},
)
def lut_nearest(
    light: Light,
    shadow: Labels,
    index: LutIndex,
    *,
    neighbours: Annotated[int, Interval(ge=1, le=16)] = 1,
) -> Slope:
    """Return the slope of the entry nearest in light: exact (3.1 and 3.3).

    A pixel that all LEDs reach is looked up in the table of all lights, a shadowed one in
    the table without its shadowed LED; if several are, without the darkest of them.  Of
    entries equally near the first is taken.

    Parameters
    ----------
    light
        K x H x W.  NaN counts as dark.
    shadow
        H x W, bit k-1 set where LED k is shadowed.
    index
        Of the tables.
    neighbours
        The mean slope of so many nearest entries is returned.

    Returns
    -------
    ndarray
        Slope 2 x H x W; zero where the table needed is empty.
    """
    count, height, width = light.shape
    lights = np.nan_to_num(light.reshape(count, -1), posinf=MOST_LIGHT, neginf=-MOST_LIGHT)
    table = _tables(lights, shadow.ravel())
    slope = np.zeros((2, height * width), np.float32)
    for number, tree in enumerate(index.trees):
        pixels = np.flatnonzero(table == number)
        if len(pixels) == 0 or index.tables[number, 0] == 0:
            continue
        query = lights[:, pixels].T.copy()
        if number:
            query[:, number - 1] = 0
        first = int(index.tables[number, 3])
        slope[:, pixels] = _mean_slope(tree, query, index.slopes[first:], neighbours)
    return slope.reshape(2, height, width)


def _tables(lights: F4, shadow: NDArray[np.uint8]) -> NDArray[np.intp]:
    """0 for lit pixels, else the number of the darkest LED among the shadowed ones."""
    bits = (shadow[None, :] >> np.arange(len(lights), dtype=np.uint8)[:, None]) & 1
    darkest = np.argmin(np.where(bits > 0, lights, np.inf), axis=0)
    return np.where(bits.any(axis=0), darkest + 1, 0)


class _Search(NamedTuple):
    """A tree of float32 places along the table's principal axes.

    Boxes along those axes are thin, and FLANN's tree knows its boxes: the way to the nearest is
    an eighth of that in SciPy's tree of light.  It is exact up to rounding, which `_settled` mends.
    """

    tree: Any
    axes: F8
    centre: F8
    places: F4
    largest: float

    def nearest(self, query: F4, asked: int) -> tuple[F8, NDArray[np.intp], F8]:
        """The distances of the nearest entries, their numbers, and the rounding of a distance."""
        places = ((query - self.centre) @ self.axes).astype(np.float32)

        def search(part: F4) -> tuple[NDArray[np.intp], F4]:
            found, squares = self.tree.knnSearch(part, asked, params=UNLIMITED)
            return found, squares

        with ThreadPoolExecutor(cores()) as pool:
            parts = list(pool.map(search, np.array_split(places, min(PARTS, len(places)))))
        found, squares = (np.concatenate(part) for part in zip(*parts, strict=True))
        rounding = ROUNDING * np.maximum(np.abs(places).max(axis=1), self.largest)
        return np.sqrt(squares.astype(np.float64)), found.astype(np.intp), rounding


@lru_cache(maxsize=9)
def _search(tree: cKDTree) -> _Search:
    """Made once for each of the tables, of which there are at most nine."""
    points: F8 = np.asarray(tree.data)
    centre = points.mean(axis=0)
    axes = np.linalg.eigh((points - centre).T @ (points - centre))[1]
    places = ((points - centre) @ axes).astype(np.float32)
    built = cv2.flann.Index(places, {"algorithm": SINGLE_TREE, "leaf_max_size": LEAF})
    return _Search(built, axes, centre, places, float(np.abs(places).max()))


def _mean_slope(tree: cKDTree, query: F4, slopes: F4, neighbours: int) -> F4:
    asked = min(neighbours + 1, len(tree.data))
    distance, found, rounding = _search(tree).nearest(query, asked)
    nearest = found[:, :neighbours]
    # In float32 the next one may be as near, or nearer: settled where it is this close.
    unsure = ALIKE * distance[:, 1:] + rounding[:, None]
    close = np.flatnonzero((np.diff(distance, axis=1) <= unsure).any(axis=1))
    if len(close):
        nearest[close] = _settled(tree, query[close], neighbours)
    total = np.zeros((2, len(query)), np.float32)
    for position in nearest.T:
        total += slopes[position].T
    return total / np.float32(nearest.shape[1])


def _settled(tree: cKDTree, query: F4, neighbours: int) -> NDArray[np.intp]:
    """The nearest by their distances in float32; of equals the first in the table."""
    asked = min(neighbours + SPARE, len(tree.data))
    _, found = tree.query(query, k=np.arange(1, asked + 1), workers=cores())
    entries: NDArray[Any] = tree.data[found].astype(np.float32)
    squares = np.zeros(found.shape, np.float32)
    for k in range(query.shape[1]):
        away = entries[..., k] - query[:, k, None]
        squares += away * away
    order = np.lexsort((found, squares), axis=1)[:, :neighbours]
    settled: NDArray[np.intp] = np.take_along_axis(found, order, axis=1)
    return settled


@lut_nearest.opencl()
def _launch(run: Launch) -> None:
    """A pixel per work-item, or the frame sorted by light and searched in packets of lanes."""
    height, width = run.sizes["H"], run.sizes["W"]
    arrays = [run.inputs[name] for name, port in lut_nearest.inputs.items() if port.kind == "array"]
    neighbours = run.settings["neighbours"]
    constants = {"LIGHTS": run.sizes["K"], "NEIGHBOURS": neighbours}
    if run.lanes == 1 or neighbours > 1:
        out = run.outputs["lut_nearest"]
        arguments = (*arrays, out, height, width)
        run.kernel("lut_nearest", (height, width), *arguments, constants=constants)
    else:
        _launch_sorted(run, arrays, constants)


def _launch_sorted(run: Launch, arrays: list[Any], constants: dict[str, int]) -> None:
    light, shadow, *index = arrays
    lights, size = run.sizes["K"], run.sizes["H"] * run.sizes["W"]
    levels = min(max((size // PIXELS_IN_CELL).bit_length() - 1, 0), MOST_LEVELS)
    cells = (1 << levels) + (lights << max(levels - SPARSER, 0))

    def launch(kernel: str, items: int, *arguments: Any) -> None:
        run.kernel(kernel, (items,), *arguments, local=(1,), constants=constants)

    samples = run.scratch((SAMPLES << levels, lights))
    medians = run.scratch((1 << levels,))
    launch("find_medians", 1, light, samples, medians, size, levels)
    cell, counts = run.scratch((size,), np.uint16), run.scratch((CHUNKS, cells), np.int32)
    launch("find_cells", CHUNKS, light, shadow, medians, cell, counts, size, levels, cells)
    starts = run.scratch((cells + 1,), np.int32)
    launch("find_starts", 1, counts, starts, CHUNKS, cells)
    place, sorted_light = run.scratch((size,), np.int32), run.scratch((size, lights))
    launch("sort_pixels", CHUNKS, light, cell, counts, place, sorted_light, size, cells)
    slopes = run.scratch((size, 2))
    launch("search_cells", cells, sorted_light, starts, *index, slopes, levels)
    launch("put_back", CHUNKS, slopes, place, run.outputs["lut_nearest"], size)


@lut_nearest.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """Tables of random light, in large images of many tops; labels of which every one occurs."""
    count = 700 if H * W < 5000 else 40_000
    entries = rng.random((count, K)).astype(np.float32)
    slopes = rng.uniform(-2, 2, (count, 2)).astype(np.float32)
    dark = np.where(rng.random(count) < 0.5, 1 << rng.integers(0, K, count), 0)
    lit = (((1 << K) - 1) & ~dark).astype(np.uint8)
    index = index_lut(entries, slopes, lit)
    shadow = np.where(rng.random((H, W)) < 0.5, rng.integers(0, 1 << K, (H, W)), 0)
    made = {f"index.{name}": value for name, value in index._asdict().items()}
    return {**made, "shadow": shadow.astype(np.uint8)}
