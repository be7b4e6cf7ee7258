"""Look up the slope of the nearest light in the tables."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tactograph.graph import Flips, SizeLimit, node
from tactograph.nodes import F4, Labels, Light, Slope
from tactograph.nodes.index_lut import LutIndex, index_lut

SPARE = 3
"""So many neighbours more are asked for, to settle ties in float32 as the kernel does."""


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
    """Return the slope of the entry nearest in light: exact, by a k-d tree (3.1 and 3.3).

    A pixel that all LEDs reach is looked up in the table of all lights, a shadowed one in
    the table without its shadowed LED; if several are, without the darkest of them.  Of
    entries equally near the first is taken.

    Parameters
    ----------
    light
        K x H x W.
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
    lights = light.reshape(count, -1)
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
    return np.where(shadow > 0, darkest + 1, 0)


def _mean_slope(tree: cKDTree, query: F4, slopes: F4, neighbours: int) -> F4:
    entries: NDArray[Any] = tree.data.astype(np.float32)
    asked = min(neighbours + SPARE, len(entries))
    _, found = tree.query(query, k=np.arange(1, asked + 1), workers=-1)
    squares = np.zeros(found.shape, np.float32)
    for k in range(query.shape[1]):
        away = entries[found, k] - query[:, k, None]
        squares += away * away
    order = np.lexsort((found, squares), axis=1)[:, :neighbours]
    nearest = np.take_along_axis(found, order, axis=1)
    total = np.zeros((2, len(query)), np.float32)
    for position in nearest.T:
        total += slopes[position].T
    return total / np.float32(nearest.shape[1])


lut_nearest.opencl(grid="H W")


@lut_nearest.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """Tables of random light, and labels of which every one occurs."""
    entries = rng.random((700, K)).astype(np.float32)
    slopes = rng.uniform(-2, 2, (700, 2)).astype(np.float32)
    lit = ((1 << K) - 1 & ~np.where(rng.random(700) < 0.5, 1 << rng.integers(0, K, 700), 0)).astype(
        np.uint8
    )
    index = index_lut(entries, slopes, lit)
    shadow = np.where(rng.random((H, W)) < 0.5, rng.integers(0, 1 << K, (H, W)), 0)
    made = {f"index.{name}": value for name, value in index._asdict().items()}
    return {**made, "shadow": shadow.astype(np.uint8)}
