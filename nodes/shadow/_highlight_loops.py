"""The loops of `label_highlights` over pixels, compiled by numba, in pieces as in `_label_loops`.

Importing numba takes half a second, so this is imported where the host looks for highlights.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tactograph.nodes import F4, U1
from tactograph.nodes._compiled import NOTHING, compiled, inlined
from tactograph.nodes.shadow._label_loops import (
    BX,
    BY,
    BZ,
    INFINITE,
    ONE,
    XY,
    XZ,
    YY,
    YZ,
    ZERO,
    ZZ,
    Vector,
    Y,
    Z,
    add_up,
    lit_by,
    load,
)  # fmt: skip

if TYPE_CHECKING:
    from tactograph.nodes.shadow._pieces import Images, Pixels, Room
    from tactograph.nodes.shadow.label_highlights import Limits

Factors = tuple[np.float32, np.float32, np.float32, np.float32, np.float32, np.float32]
"""A symmetric matrix taken apart into L D L^T: one over D, then yx, zx and zy of L."""

SOFTLY, LEAST, SHORTEST = np.float32(1e-6), np.float32(1e-20), np.float32(1e-6)
LEAST_SPREAD = np.float32(1e-12)


@compiled
def mark(first: int, last: int, images: Images, limits: Limits, room: Room, marked: U1) -> None:
    """Enter the bit of the LED, if any, that is brighter than the others allow, in some rows."""
    columns, most = images.x.size, room.best.cost.size
    for row in range(first, last):
        for start in range(0, columns, most):
            count = min(most, columns - start)
            load(images, row, start, count, room.pixels)
            _fit(room.pixels, count, NOTHING, room.sums, room.judged, room.best.misfit)
            found = _choose_unlikely(room, count, limits.unlikely)
            if found:
                _mark_piece(limits, room, found)
            for j in range(found):
                marked[row, start + room.where[j]] = room.tried.used[j]


@compiled
def _choose_unlikely(room: Room, count: int, unlikely: np.float32) -> int:
    """Gather the pixels that all LEDs together do not explain; return how many they are.

    If level film explains a pixel's light, the best normal explains it, too.
    """
    pixels, chosen, found = room.pixels, room.chosen, 0
    for i in range(count):
        if not room.best.misfit[i] > unlikely or not _level_misfit(pixels, i) > unlikely:
            continue
        room.where[found] = i
        for k in range(len(pixels.light)):
            chosen.light[k, found] = pixels.light[k, i]
            chosen.sigma[k, found] = pixels.sigma[k, i]
            chosen.weight[k, found] = pixels.weight[k, i]
            for axis in (0, Y, Z):
                chosen.vectors[k, found + axis] = pixels.vectors[k, i + axis]
        found += 1
    return found


@inlined
def _level_misfit(pixels: Pixels, i: int) -> np.float32:
    """The chi-square that level film leaves."""
    total = ZERO
    for k in range(len(pixels.light)):
        away = pixels.light[k, i] - pixels.vectors[k, i + Z]
        total += pixels.weight[k, i] * away * away
    return total


@compiled
def _mark_piece(limits: Limits, room: Room, count: int) -> None:
    """Leave each LED out in turn; the one without which the others fit best is a highlight if it
    is bright and faces the film half-way to the camera."""
    pixels, marked, least = room.chosen, room.tried.used, room.tried.cost
    sums, normal, misfit = room.sums, room.judged, room.tried.misfit
    for i in range(count):
        least[i], marked[i] = INFINITE, np.uint8(0)
    for k in range(len(pixels.light)):
        _fit(pixels, count, 1 << k, sums, normal, misfit)
        v, light, sigma, bit = pixels.vectors[k], pixels.light[k], pixels.sigma[k], np.uint8(1 << k)
        for i in range(count):
            x, y, z = v[i], v[i + Y], v[i + Z]
            told = _solved(_factors(sums, i), (x, y, z))
            doubt = x * told[0] + y * told[1] + z * told[2]
            over = light[i] - lit_by(v, normal, i)
            bright = over > limits.excess * np.sqrt(sigma[i] * sigma[i] + doubt)
            length = np.sqrt(x * x + y * y + z * z)
            hx, hy, hz = x / length, y / length, z / length + ONE
            length = np.sqrt(hx * hx + hy * hy + hz * hz)
            along = hx * normal[i] + hy * normal[i + Y] + hz * normal[i + Z]
            found = bright & (along > limits.near * length) & (misfit[i] < limits.likely)
            if misfit[i] < least[i]:
                least[i], marked[i] = misfit[i], bit if found else np.uint8(0)


@compiled
def _fit(pixels: Pixels, count: int, left_out: int, sums: F4, normal: F4, misfit: F4) -> None:
    """Least squares without an LED, then the nearest normal of unit length in the noise's metric;
    and the chi-square that it leaves."""
    add_up(pixels, count, left_out, sums)
    for i in range(count):
        factors = _factors(sums, i)
        x, y, z = _solved(factors, (sums[i + BX], sums[i + BY], sums[i + BZ]))
        length = np.sqrt(x * x + y * y + z * z)
        short = max(length, SHORTEST)
        unit = x / short, y / short, z / short
        along = _solved(factors, unit)
        spread = unit[0] * along[0] + unit[1] * along[1] + unit[2] * along[2]
        beyond = (length - ONE) / max(spread, LEAST_SPREAD)
        x, y, z = x - along[0] * beyond, y - along[1] * beyond, z - along[2] * beyond
        length = max(np.sqrt(x * x + y * y + z * z), SHORTEST)
        normal[i], normal[i + Y], normal[i + Z] = x / length, y / length, z / length
        misfit[i] = ZERO
    for k in range(len(pixels.light)):
        if not left_out >> k & 1:
            v, light, weight = pixels.vectors[k], pixels.light[k], pixels.weight[k]
            for i in range(count):
                away = light[i] - lit_by(v, normal, i)
                misfit[i] += weight[i] * away * away


@inlined
def _factors(sums: F4, i: int) -> Factors:
    """The sum of weight v v^T, softened, with pivots that stay above zero."""
    xx, xy, xz, yy, yz, zz = (
        sums[i], sums[i + XY], sums[i + XZ], sums[i + YY], sums[i + YZ], sums[i + ZZ],
    )  # fmt: skip
    soft = max(SOFTLY * (xx + yy + zz), LEAST)
    first = ONE / (xx + soft)
    yx, zx = xy * first, xz * first
    second = ONE / max(yy + soft - yx * xy, soft)
    zy = (yz - yx * xz) * second
    third = ONE / max(zz + soft - zx * xz - zy * (yz - yx * xz), soft)
    return first, second, third, yx, zx, zy


@inlined
def _solved(factors: Factors, right: Vector) -> Vector:
    """The inverse of a matrix times a vector."""
    first, second, third, yx, zx, zy = factors
    y = right[1] - yx * right[0]
    z = (right[2] - zx * right[0] - zy * y) * third
    y = y * second - zy * z
    return right[0] * first - yx * y - zx * z, y, z
