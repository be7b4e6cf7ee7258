"""Index the look-up tables once, so that nearest neighbours are found fast."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tactograph.graph import Port, node
from tactograph.nodes import F4, LutLight, LutLit, LutSlope

LEAF = 8
FAR = np.float32(1e15)
"""Fills the last leaf; no light is ever near it."""
SLACK = np.float32(4e-6)
"""Boxes are wider by this, so that rounding never hides an entry from the search."""


class LutIndex(NamedTuple):
    """K + 1 tables, each a k-d tree: table 0 of all lights, table k without LED k.

    A tree is complete: node i has the children 2i and 2i + 1, its boxes lie in that order
    from 1, its leaves hold the same number of entries each.
    """

    entries: Annotated[F4, Port("M K", "1")]
    """Light of the entries in leaf order; the column of the LED left out is zero."""
    slopes: Annotated[F4, Port("M 2", "mm/mm", low=-2, high=2)]
    boxes: Annotated[F4, Port("B 2 K", "1")]
    """Lowest and highest coordinate along the table's principal axes."""
    axes: Annotated[F4, Port("T K K", "1")]
    tables: Annotated[NDArray[np.int32], Port("T 4", "1")]
    """Number of leaves, entries in a leaf, first box, first entry."""
    trees: tuple[cKDTree, ...]
    """The same tables as SciPy's trees, for the host; positions are those of `entries`."""


class _Table(NamedTuple):
    entries: F4
    slopes: F4
    boxes: F4
    axes: F4
    leaves: int


@node
def index_lut(light: LutLight, slope: LutSlope, lit: LutLit) -> LutIndex:
    """Split the calibration pixels into their K + 1 tables and index each (3.1 and 3.3).

    Entries of equal light are merged into one with their mean slope.  The trees are split
    along the principal axes of the table: a Lambertian film's light lies near a surface of
    two dimensions, so boxes along those axes are thin.

    Parameters
    ----------
    light, slope, lit
        N x K, N x 2, N: the calibration pixels, and the LEDs that reach them.

    Returns
    -------
    LutIndex
        A table that no pixel belongs to has no leaves.
    """
    count = light.shape[1]
    every = (1 << count) - 1
    tables = [_table(light, slope, lit, every, None)]
    tables += [_table(light, slope, lit, every & ~(1 << k), k) for k in range(count)]
    first_box = np.cumsum([0, *(len(t.boxes) for t in tables)])
    first_entry = np.cumsum([0, *(len(t.entries) for t in tables)])
    info = [
        (t.leaves, len(t.entries) // max(t.leaves, 1), first_box[i], first_entry[i])
        for i, t in enumerate(tables)
    ]
    return LutIndex(
        np.concatenate([t.entries for t in tables]),
        np.concatenate([t.slopes for t in tables]),
        np.concatenate([t.boxes for t in tables]),
        np.stack([t.axes for t in tables]),
        np.array(info, np.int32),
        tuple(cKDTree(t.entries) for t in tables),
    )


def _table(
    light: LutLight, slope: LutSlope, lit: LutLit, needed: int, dropped: int | None
) -> _Table:
    """One table: the pixels that all `needed` LEDs reach, the dropped light put to zero."""
    chosen = (lit & needed) == needed
    points = light[chosen].copy()
    count = light.shape[1]
    if dropped is not None:
        points[:, dropped] = 0
    # Two lights do not determine a slope: without a fourth LED there is nothing to drop.
    if len(points) == 0 or (dropped is not None and count < 4):
        none = np.zeros((0, count), np.float32)
        axes = np.eye(count, dtype=np.float32)
        return _Table(none, none[:, :2], np.zeros((0, 2, count), np.float32), axes, 0)
    points, slopes = _merged(points, slope[chosen])
    axes = np.linalg.eigh(np.cov(points.T.astype(np.float64)))[1].T[::-1].astype(np.float32)
    order, leaves = _leaf_order(points @ axes.T)
    padding = np.full((leaves * -(-len(points) // leaves) - len(points), count), FAR)
    entries = np.concatenate([points, padding])[order]
    values = np.concatenate([slopes, np.zeros((len(padding), 2), np.float32)])[order]
    return _Table(entries, values, _boxes(entries, axes, leaves), axes, leaves)


def _merged(points: F4, slopes: F4) -> tuple[F4, F4]:
    """Entries of distinct light, each with the mean slope of the pixels that share it."""
    distinct, group = np.unique(points, axis=0, return_inverse=True)
    sums = [np.bincount(group.ravel(), slopes[:, i]) for i in (0, 1)]
    means = np.stack(sums, axis=1) / np.bincount(group.ravel())[:, None]
    return distinct, means.astype(np.float32)


def _leaf_order(coordinates: F4) -> tuple[NDArray[np.int64], int]:
    """Halve the points along their widest extent until a part holds at most LEAF of them.

    Returns the order of the points, those past the end standing for the padding.
    """
    count = len(coordinates)
    leaves = 1 << max(0, int(np.ceil(np.log2(count / LEAF))))
    total = leaves * -(-count // leaves)
    # The padding is spread along the widest axis like points at its end.
    places = np.concatenate(
        [coordinates, np.broadcast_to(coordinates.max(0), (total - count, coordinates.shape[1]))]
    )
    order = np.arange(total)[None, :]
    while len(order) < leaves:
        there = places[order]
        widest = np.ptp(there, axis=1).argmax(axis=1)
        key = np.take_along_axis(there, widest[:, None, None], axis=2)[..., 0]
        half = np.argpartition(key, order.shape[1] // 2, axis=1)
        order = np.take_along_axis(order, half, axis=1).reshape(2 * len(order), -1)
    return order.ravel(), leaves


def _boxes(entries: F4, axes: F4, leaves: int) -> F4:
    """The boxes of all nodes in heap order; box 0 is not used."""
    rotated = np.where(entries[:, :1] < FAR, entries @ axes.T, np.nan)
    parts = rotated.reshape(leaves, -1, axes.shape[0])
    found = np.zeros((2 * leaves, 2, axes.shape[0]), np.float32)
    # A leaf of nothing but padding keeps an inverted box, which is far from everything.
    low = np.where(np.isnan(parts), FAR, parts).min(axis=1)
    high = np.where(np.isnan(parts), -FAR, parts).max(axis=1)
    while True:
        count = len(low)
        found[count : 2 * count, 0] = low - SLACK
        found[count : 2 * count, 1] = high + SLACK
        if count == 1:
            return found
        low = low.reshape(count // 2, 2, -1).min(axis=1)
        high = high.reshape(count // 2, 2, -1).max(axis=1)
