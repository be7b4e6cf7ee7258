"""The look-up compiled for the host: packets of pixels of similar light search a tree together.

It is the search of ``lut_nearest.cl``, ``table_tree.clh`` and ``sort_by_light.clh``, lane by lane,
with two differences: it keeps a list of any number of nearest entries, and squares of distances
round as in NumPy, so that almost equally near entries have the same order as in NumPy.

Long because numba recompiles a cached function only when its own file has changed.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit, types
from numpy.typing import NDArray

from tactograph.nodes import F4, I4, U1
from tactograph.nodes._compiled import compiled_for
from tactograph.nodes.slope._lanes import (
    LANES,
    Floats,
    Ints,
    choose,
    highest_lane,
    lanes_of,
    less_of,
    load,
    lowest_bit,
    lowest_lane,
    more_of,
    multiply_add,
    splat,
    store,
)
from tactograph.nodes.slope.index_lut import LEAF, WIDE
from tactograph.nodes.slope.lut_nearest import PIECE, SPARSER

U2 = NDArray[np.uint16]
I8 = NDArray[np.int64]
CAUTION = np.float32(0.99999)
"""Factor on squared distances to boxes, below 1 so that rounding hides no entry."""
MOST_LIGHT = np.float32(1e15)
BINS = 16
"""The pixels of a piece are sorted into BINS x BINS bins."""
PADDED = PIECE + LANES
"""Distance from the light of a piece under one LED to that under the next."""
ZERO, INFINITE, TINY = np.float32(0), np.float32(np.inf), np.float32(1e-20)
NONE = np.int32(2**31 - 1)
"""Stands for an entry's number where fewer entries were found."""


class _Table(NamedTuple):
    """One table of `index_lut`, its arrays flat; `boxes` begins with those of the tops."""

    lights: int
    tops: int
    groups: int
    boxes: F4
    axes: F4
    centre: F4
    entries: F4
    numbers: I4


class _Packet(NamedTuple):
    """LANES pixels: their light, the same along the table's axes, and the box around them."""

    light: F4
    point: F4
    low: F4
    high: F4


class _Nearest(NamedTuple):
    """The entries nearest to each pixel of a packet, nearest first, LANES side by side."""

    squares: F4
    numbers: I4
    leaves: I4
    """Leaves of the nearest entries only."""
    last: int
    """Where in the list the farthest entries are."""


@njit
def _tame(light: np.float32) -> np.float32:
    """Light as the search takes it: NaN counts as dark, and squares stay finite."""
    return min(max(light, -MOST_LIGHT), MOST_LIGHT) if light == light else ZERO


@njit(forceinline=True)
def _box_gaps(packet: _Packet, table: _Table, at: int) -> Floats:
    """Squared distances from the box around a packet to 16 boxes."""
    square = splat(ZERO)
    for k in range(table.lights):
        below = load(table.boxes, at + WIDE * k) - splat(packet.high[k])
        above = splat(packet.low[k]) - load(table.boxes, at + WIDE * (table.lights + k))
        away = more_of(more_of(below, above), splat(ZERO))
        square = multiply_add(away, away, square)
    return square * splat(CAUTION)


@njit(forceinline=True)
def _boxes_within(packet: _Packet, table: _Table, at: int, reach: np.float32) -> int:
    """Those of 16 boxes that are near enough to the box around a packet, a bit each."""
    return lanes_of(_box_gaps(packet, table, at) <= splat(reach))


@njit(forceinline=True)
def _may_hold_nearer(packet: _Packet, table: _Table, nearest: _Nearest, box: int) -> int:
    """The pixels, a bit each, that are near enough to one box to find an entry there."""
    square = splat(ZERO)
    for k in range(table.lights):
        point = load(packet.point, LANES * k)
        there = more_of(point, splat(table.boxes[box + WIDE * k]))
        there = less_of(there, splat(table.boxes[box + WIDE * (table.lights + k)]))
        away = point - there
        square = multiply_add(away, away, square)
    return lanes_of(square * splat(CAUTION) <= load(nearest.squares, nearest.last))


@njit(forceinline=True)
def _reach(nearest: _Nearest) -> np.float32:
    return highest_lane(load(nearest.squares, nearest.last))


@njit
def _enter(nearest: _Nearest, square: Floats, number: Ints, leaf: int) -> None:
    """Insert an entry into the sorted lists, and move farther entries on by one place."""
    closest = square < load(nearest.squares, 0)
    store(choose(closest, splat(np.int32(leaf)), load(nearest.leaves, 0)), nearest.leaves, 0)
    for place in range(0, nearest.last + LANES, LANES):
        other, its_number = load(nearest.squares, place), load(nearest.numbers, place)
        before = (square < other) | ((square == other) & (number < its_number))
        store(choose(before, square, other), nearest.squares, place)
        store(choose(before, number, its_number), nearest.numbers, place)
        # Leaves are padded with entries that also occur elsewhere.
        again = number == its_number
        square = choose(again, splat(INFINITE), choose(before, other, square))
        number = choose(again, splat(NONE), choose(before, its_number, number))


@njit
def _scan_leaf(nearest: _Nearest, packet: _Packet, table: _Table, leaf: int) -> None:
    for entry in range(LEAF * leaf, LEAF * (leaf + 1)):
        square = splat(ZERO)
        for k in range(table.lights):
            light = splat(table.entries[entry * table.lights + k])
            away = light - load(packet.light, LANES * k)
            square = square + away * away
        if lanes_of(square <= load(nearest.squares, nearest.last)):
            _enter(nearest, square, splat(table.numbers[entry]), leaf)


@njit(forceinline=True)
def _walk_middle(
    nearest: _Nearest, packet: _Packet, table: _Table, middle: int, first: int, second: int
) -> None:
    """Scan the leaves of one middle that may hold a nearer entry, except two already scanned."""
    at = _boxes_of(table, table.groups + table.tops + middle)
    near = _boxes_within(packet, table, at, _reach(nearest))
    while near:
        box = lowest_bit(near)
        near &= near - 1
        leaf = WIDE * middle + box
        if leaf not in (first, second) and _may_hold_nearer(packet, table, nearest, at + box):
            _scan_leaf(nearest, packet, table, leaf)


@njit(forceinline=True)
def _boxes_of(table: _Table, row: int) -> int:
    return 2 * WIDE * table.lights * row


@njit(forceinline=True)
def _walk(nearest: _Nearest, packet: _Packet, table: _Table, first: int, second: int) -> None:
    """Scan two leaves that are likely to be near, then all others that may hold nearer entries."""
    _scan_leaf(nearest, packet, table, first)
    if second != first:
        _scan_leaf(nearest, packet, table, second)
    for group in range(table.groups):
        at = _boxes_of(table, group)
        near_tops = _boxes_within(packet, table, at, _reach(nearest))
        while near_tops:
            box = lowest_bit(near_tops)
            near_tops &= near_tops - 1
            top = WIDE * group + box
            if top >= table.tops or not _may_hold_nearer(packet, table, nearest, at + box):
                continue
            middles = _boxes_of(table, table.groups + top)
            near = _boxes_within(packet, table, middles, _reach(nearest))
            while near:
                box = lowest_bit(near)
                near &= near - 1
                if _may_hold_nearer(packet, table, nearest, middles + box):
                    _walk_middle(nearest, packet, table, WIDE * top + box, first, second)


@njit
def _closest(packet: _Packet, table: _Table, row: int, least: np.float32) -> tuple[int, np.float32]:
    """Which of 16 boxes is the closest, -1 if none is within `least`, and how close."""
    squares = _box_gaps(packet, table, _boxes_of(table, row))
    here = lowest_lane(squares)
    if here < least:
        return lowest_bit(lanes_of(squares == splat(here))), here
    return -1, least


@njit
def _descend(packet: _Packet, table: _Table) -> int:
    """The leaf at the end of a descent that always takes the closest box."""
    node, least = 0, INFINITE
    for group in range(table.groups):
        box, least = _closest(packet, table, group, least)
        if box >= 0:
            node = WIDE * group + box
    for rows in (table.groups, table.groups + table.tops):
        box, _ = _closest(packet, table, rows + node, INFINITE)
        node = WIDE * node + box
    return node


@njit
def _put(packet: _Packet, table: _Table) -> None:
    """Fill in a packet's coordinates along the table's axes, and the box around its pixels."""
    for j in range(table.lights):
        point = splat(-table.centre[j])
        for k in range(table.lights):
            axis = splat(table.axes[j * table.lights + k])
            point = multiply_add(axis, load(packet.light, LANES * k), point)
        store(point, packet.point, LANES * j)
        packet.low[j], packet.high[j] = lowest_lane(point), highest_lane(point)


@njit
def _extent(light: F4, at: int, count: int) -> tuple[np.float32, np.float32]:
    """The lowest light, and the range of the light, of pixels from `at` on."""
    low = high = load(light, at)
    for i in range(LANES, count, LANES):
        low, high = less_of(load(light, at + i), low), more_of(load(light, at + i), high)
    return lowest_lane(low), highest_lane(high) - lowest_lane(low)


@njit
def _sort_piece(order: I4, bins: I4, light: F4, lights: int, count: int) -> None:
    """Order a piece by bins of light under the two LEDs where its range is largest.

    The bins are traversed row by row, in alternating directions.
    """
    row_at = column_at = 0
    row_low = column_low = ZERO
    row_wide = column_wide = np.float32(-1)
    for at in range(0, PADDED * lights, PADDED):
        low, wide = _extent(light, at, count)
        if wide > row_wide:
            column_at, column_low, column_wide = row_at, row_low, row_wide
            row_at, row_low, row_wide = at, low, wide
        elif wide > column_wide:
            column_at, column_low, column_wide = at, low, wide
    rows = np.float32(BINS - 0.01) / max(row_wide, TINY)
    columns = np.float32(BINS - 0.01) / max(column_wide, TINY)
    starts = np.zeros(BINS * BINS + 1, np.int32)
    for i in range(count):
        row = int((light[row_at + i] - row_low) * rows)
        column = int((light[column_at + i] - column_low) * columns)
        bins[i] = BINS * row + (BINS - 1 - column if row & 1 else column)
        starts[bins[i] + 1] += 1
    for number in range(BINS * BINS):
        starts[number + 1] += starts[number]
    for i in range(count):
        order[starts[bins[i]]] = i
        starts[bins[i]] += 1
    order[count : count + LANES] = order[count - 1]


@njit
def _gather(piece: F4, light: F4, pixels: I8, dropped: int) -> None:
    """Gather the light of a piece, LED by LED, one of them dark; its last pixel pads a packet."""
    for k in range(len(light)):
        for i in range(len(pixels) + LANES):
            value = _tame(light[k, pixels[min(i, len(pixels) - 1)]])
            piece[PADDED * k + i] = ZERO if k == dropped else value


@njit
def _search(
    nearest: _Nearest, packet: _Packet, table: _Table, piece: F4, order: I4, start: int
) -> None:
    """Find the entries of LANES pixels of a piece, starting where the previous packet ended."""
    for k in range(table.lights):
        for lane in range(LANES):
            packet.light[LANES * k + lane] = piece[PADDED * k + order[start + lane]]
    _put(packet, table)
    if start == 0:
        nearest.leaves[:] = _descend(packet, table)
    first, second = nearest.leaves[LANES - 1], nearest.leaves[LANES // 2]
    nearest.squares[:] = INFINITE
    nearest.numbers[:] = NONE
    _walk(nearest, packet, table, np.int64(first), np.int64(second))


@njit
def _mean_slope(nearest: _Nearest, lane: int, slopes: F4) -> tuple[np.float32, np.float32]:
    """The mean slope of the entries in one lane of the lists."""
    p = q = ZERO
    found = 0
    for place in range(lane, nearest.last + LANES, LANES):
        number = nearest.numbers[place]
        if number != NONE:
            p, q, found = p + slopes[2 * number], q + slopes[2 * number + 1], found + 1
    return p / np.float32(found), q / np.float32(found)


@njit
def _table_of(light: F4, shadow: int, pixel: int) -> int:
    """0 for lit pixels, else the number of the darkest LED among the shadowed ones."""
    table, least = 0, INFINITE
    for k in range(len(light)):
        value = _tame(light[k, pixel])
        if shadow >> k & 1 and value < least:
            table, least = k + 1, value
    return table


@njit
def _read_table(index: Any, number: int, lights: int) -> _Table:
    entries, numbers, _, boxes, axes, centres, tables = index
    tops, first_box, first_entry = int(tables[number, 0]), tables[number, 1], tables[number, 2]
    return _Table(
        lights,
        tops,
        (tops + WIDE - 1) // WIDE,
        boxes[2 * WIDE * lights * first_box :],
        axes[lights * lights * number :],
        centres[lights * number :],
        entries[lights * first_entry :],
        numbers[first_entry:],
    )


def _array(element: Any, dimensions: int, filled: bool = False) -> Any:
    return types.Array(element, dimensions, "C", readonly=not filled)


_FLAT, _LIGHT = _array(types.float32, 1), _array(types.float32, 2)
_NUMBER, _NUMBERS, _PLACES = types.int64, _array(types.int32, 1), _array(types.int64, 1)
_SHADOW, _CELLS = _array(types.uint8, 1), _array(types.uint16, 1, filled=True)
_INDEX = types.Tuple(
    (_FLAT, _NUMBERS, _FLAT, _FLAT, _FLAT, _FLAT, _array(types.int32, 2)),
)
_SLOPES = _array(types.float32, 2, filled=True)


@compiled_for(types.void(_NUMBER, _NUMBER, _LIGHT, _SHADOW, _FLAT, _NUMBER, _CELLS))
def find_cells(
    first: int, past: int, light: F4, shadow: U1, medians: F4, levels: int, cells: U2
) -> None:
    """Fill in the cells of the pixels `first` up to `past`, by their light and their table.

    Parameters
    ----------
    light, shadow
        K x N, N.
    medians
        The medians that separate cells, numbered as in a heap from 1.
    levels
        Number of medians on the way to a cell.
    cells
        N.
    """
    lights, sparse = len(light), max(levels - SPARSER, 0)
    for pixel in range(first, past):
        cell = 1
        for level in range(levels):
            cell = 2 * cell + (light[level % lights, pixel] > medians[cell])
        table = _table_of(light, shadow[pixel], pixel) if shadow[pixel] else 0
        if table > 0:
            cell = (cell - (1 << levels)) >> (levels - sparse)
            cell += (2 << levels) + ((table - 1) << sparse)
        cells[pixel] = cell - (1 << levels)


@compiled_for(
    types.void(_NUMBER, _NUMBER, _LIGHT, _PLACES, _PLACES, _NUMBER, _INDEX, _NUMBER, _SLOPES)
)
def search_cells(
    first: int,
    past: int,
    light: F4,
    pixels: I8,
    starts: I8,
    levels: int,
    index: Any,
    neighbours: int,
    slope: F4,
) -> None:
    """Fill in the slopes of the pixels in the cells `first` up to `past`.

    Parameters
    ----------
    light
        K x N.
    pixels, starts
        N, C + 1: the pixels cell by cell, and where each of the C cells starts.
    levels
        As `find_cells` takes them.
    index
        The arrays of `index_lut`, all but the last flat.
    neighbours
        Number of nearest entries whose mean is the slope of a pixel.
    slope
        2 x N; left as it is where the table needed is empty.
    """
    lights, sparse = len(light), max(levels - SPARSER, 0)
    piece, order = np.empty(PADDED * lights, np.float32), np.empty(PADDED, np.int32)
    bins = np.empty(PIECE, np.int32)
    packet = _Packet(
        np.empty(LANES * lights, np.float32),
        np.empty(LANES * lights, np.float32),
        np.empty(lights, np.float32),
        np.empty(lights, np.float32),
    )
    nearest = _Nearest(
        np.empty(LANES * neighbours, np.float32),
        np.empty(LANES * neighbours, np.int32),
        np.empty(LANES, np.int32),
        LANES * (neighbours - 1),
    )
    for cell in range(first, past):
        number = 0 if cell < 1 << levels else 1 + ((cell - (1 << levels)) >> sparse)
        table = _read_table(index, number, lights)
        if table.tops == 0:
            continue
        slopes = index[2][2 * index[6][number, 3] :]
        for start in range(starts[cell], starts[cell + 1], PIECE):
            chosen = pixels[start : min(start + PIECE, starts[cell + 1])]
            _gather(piece, light, chosen, number - 1)
            _sort_piece(order, bins, piece, lights, len(chosen))
            for i in range(0, len(chosen), LANES):
                _search(nearest, packet, table, piece, order, i)
                for lane in range(min(LANES, len(chosen) - i)):
                    pixel = chosen[order[i + lane]]
                    slope[0, pixel], slope[1, pixel] = _mean_slope(nearest, lane, slopes)
