"""Index the look-up tables once, so that a device finds nearest neighbours fast.

The look-up is exact.  The index is a tree with three levels of 16 boxes along the table's principal
axes, since a Lambertian film's light lies near a surface of two dimensions.  The light of film at
rest lies off that surface: many entries are then almost equally near, and only boxes along all
principal axes prune them.  On CPUs the kernel sorts the frame by light, and 16 pixels of similar
light search the tree together.  Entries of equal light are merged, so all back ends find the same
slope.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import Port, node
from tactograph.graph.cores import cores
from tactograph.nodes import F4, I4, LutLight, LutLit, LutSlope

LEAF_ENTRIES = 8
"""Entries in a leaf; the kernel's LEAF_ENTRIES."""
GROUP_BOXES = 16
"""Boxes that are tested together: the leaves of a middle, or the middles of a top."""
TOP_ENTRIES = GROUP_BOXES * GROUP_BOXES * LEAF_ENTRIES
PAD_POSITION = np.float32(1e18)
"""Position of the boxes that pad the last group, beyond any light."""
BOX_SLACK_SHARE = 4e-6
"""Share of the largest light by which boxes are widened, so that rounding hides no entry."""


class LutIndex(NamedTuple):
    """K + 1 tables, each a tree: table 0 of all lights, table k without LED k.

    A tree has `tops`, each of 16 middles, each of 16 leaves, each of 8 entries.  16 sibling boxes
    lie side by side: first those of the tops, then those of each top's middles, then those of each
    middle's leaves.
    """

    entries: Annotated[F4, Port("M K", "1")]
    """Light of the entries leaf by leaf; the column of the LED left out is zero."""
    numbers: Annotated[I4, Port("M", "entry number")]
    """Number of each entry in its table; the last places repeat entries."""
    slopes: Annotated[F4, Port("E 2", "mm/mm", low=-2, high=2)]
    """Slope of every table's entries, by their numbers."""
    boxes: Annotated[F4, Port("B 2 K 16", "1")]
    """Lowest and highest coordinate along the table's principal axes, from its centre."""
    axes: Annotated[F4, Port("T K K", "1")]
    centres: Annotated[F4, Port("T K", "1")]
    tables: Annotated[I4, Port("T 4", "1")]
    """Number of tops, first row of `boxes`, of `entries`, of `slopes`."""


@node
def index_lut(light: LutLight, slope: LutSlope, lit: LutLit) -> LutIndex:
    """Split the calibration pixels into their K + 1 tables and index each (3.1 and 3.3).

    Entries of equal light are merged into one with their mean slope.

    Parameters
    ----------
    light, slope, lit : N x K, N x 2, N: the calibration pixels, and the LEDs that reach them

    Returns
    -------
    A table that no pixel belongs to has no tops.
    """
    count = light.shape[1]
    # Sorting releases the interpreter's lock, so threads help.
    with ThreadPoolExecutor(cores()) as pool:
        tables = list(pool.map(lambda k: _table(light, slope, lit, k), (None, *range(count))))
    index = LutIndex(*map(np.concatenate, zip(*tables, strict=True)))
    lengths = np.array([[len(t.boxes), len(t.entries), len(t.slopes)] for t in tables], np.int32)
    index.tables[:, 1:] = np.cumsum(lengths, axis=0) - lengths
    return index


def _table(light: LutLight, slope: LutSlope, lit: LutLit, dropped: int | None) -> LutIndex:
    """One table: the pixels that all LEDs but the dropped one reach, with its light set to zero.

    It starts at the first row of everything.
    """
    count = light.shape[1]
    needed = (1 << count) - 1 & ~(0 if dropped is None else 1 << dropped)
    chosen = (lit & needed) == needed
    points = light[chosen].copy()
    if dropped is not None:
        points[:, dropped] = 0
    # Two lights do not determine a slope: without a fourth LED there is nothing to drop.
    if len(points) == 0 or (dropped is not None and count < 4):
        return _empty(count)
    points, slopes = _merged(points, slope[chosen])
    axes, centre = _principal_axes(points)
    places = (points @ axes.T.astype(np.float64) - centre).astype(np.float32)
    order = _leaf_order(places)
    boxes = _boxes(places[order], np.float32(BOX_SLACK_SHARE * np.abs(points).max()))
    numbers = order.ravel().astype(np.int32)
    tables = np.array([[len(numbers) // TOP_ENTRIES, 0, 0, 0]], np.int32)
    return LutIndex(points[numbers], numbers, slopes, boxes, axes[None], centre[None], tables)


def _empty(count: int) -> LutIndex:
    none = np.zeros((0, count), np.float32)
    axes = np.eye(count, dtype=np.float32)[None]
    boxes = np.zeros((0, 2, count, GROUP_BOXES), np.float32)
    numbers, tables = np.zeros(0, np.int32), np.zeros((1, 4), np.int32)
    return LutIndex(none, numbers, none[:, :2], boxes, axes, axes[:, 0], tables)


def _merged(points: F4, slopes: F4) -> tuple[F4, F4]:
    """Entries of distinct light, each with the mean slope of the pixels that share it."""
    distinct, group = np.unique(points, axis=0, return_inverse=True)
    sums = [np.bincount(group.ravel(), slopes[:, i]) for i in (0, 1)]
    means = np.stack(sums, axis=1) / np.bincount(group.ravel())[:, None]
    return distinct, means.astype(np.float32)


def _principal_axes(points: F4) -> tuple[F4, F4]:
    """The principal axes in rows, the widest first, and the mean light along them."""
    mean = points.mean(axis=0, dtype=np.float64)
    away = points - mean
    axes = np.linalg.eigh(away.T @ away)[1].T[::-1].astype(np.float32)
    return axes, (axes.astype(np.float64) @ mean).astype(np.float32)


def _leaf_order(places: F4) -> NDArray[np.intp]:
    """The numbers of the entries, one leaf per row; entries repeat until all leaves are full."""
    tops = -(-len(places) // TOP_ENTRIES)

    def split_by_top(part: NDArray[np.intp]) -> list[NDArray[np.intp]]:
        at = part.shape[1] // TOP_ENTRIES // 2 * TOP_ENTRIES
        if not at:
            return [part]
        part = _split(places, part, at)
        return split_by_top(part[:, :at]) + split_by_top(part[:, at:])

    everything = np.resize(np.arange(len(places)), (1, tops * TOP_ENTRIES))
    order = np.concatenate(split_by_top(everything))
    while order.shape[1] > LEAF_ENTRIES:
        half = order.shape[1] // 2
        order = _split(places, order, half).reshape(2 * len(order), half)
    return order


def _split(places: F4, order: NDArray[np.intp], at: int) -> NDArray[np.intp]:
    """Split every row of entries along its own widest extent: the `at` lowest come first."""
    by_leaf = places[order]
    widest = np.ptp(by_leaf, axis=1).argmax(axis=1)
    key = np.take_along_axis(by_leaf, widest[:, None, None], axis=2)[..., 0]
    return np.take_along_axis(order, np.argpartition(key, at, axis=1), axis=1)


def _boxes(leaves: F4, slack: np.float32) -> F4:
    """The boxes of tops, middles and leaves, from the entries' coordinates leaf by leaf."""
    count = leaves.shape[2]
    level = np.stack([leaves.min(axis=1) - slack, leaves.max(axis=1) + slack], axis=1)
    levels = [level]
    for _ in range(2):
        siblings = level.reshape(-1, GROUP_BOXES, 2, count)
        level = np.stack([siblings[:, :, 0].min(axis=1), siblings[:, :, 1].max(axis=1)], axis=1)
        levels.append(level)
    missing = np.full((-len(level) % GROUP_BOXES, 2, count), PAD_POSITION)
    levels[-1] = np.concatenate([level, missing])
    grouped = np.concatenate([x.reshape(-1, GROUP_BOXES, 2, count) for x in reversed(levels)])
    return np.ascontiguousarray(grouped.transpose(0, 2, 3, 1))
