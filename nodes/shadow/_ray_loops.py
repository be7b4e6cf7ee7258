"""The loops of `cast_shadows` and `shadow_constraints` along rays, compiled by numba.

Importing numba takes half a second, so this is imported where the host follows rays.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tactograph.nodes import F4, U1
from tactograph.nodes._compiled import compiled, inlined

if TYPE_CHECKING:
    from tactograph.nodes.shadow.shadow_constraints import LedFilm, Rays

ZERO, HALF, ONE = np.float32(0), np.float32(0.5), np.float32(1)
STEP, TINY = np.float32(0.5), np.float32(1e-6)
FAINTEST = np.float32(0.02)
FARTHEST_END = np.float32(1.5)
NEAREST_EDGE = np.float32(1.2)


@inlined
def _weights(count: int, at: np.float32) -> tuple[int, int, np.float32]:
    """The pixels before and behind a place along a row or column, and the weight of the second."""
    first = int(min(max(np.floor(at), ZERO), np.float32(count - 1)))
    return first, min(first + 1, count - 1), min(max(at - np.float32(first), ZERO), ONE)


@inlined
def _bilinear(plane: F4 | U1, x: np.float32, y: np.float32) -> np.float32:
    """What `light._bilinear.bilinear` gives at a point."""
    upper, lower, v = _weights(plane.shape[0], y)
    left, right, u = _weights(plane.shape[1], x)
    above = np.float32(plane[upper, left]) * (ONE - u) + np.float32(plane[upper, right]) * u
    below = np.float32(plane[lower, left]) * (ONE - u) + np.float32(plane[lower, right]) * u
    return above * (ONE - v) + below * v


@compiled
def cast(
    first: int, last: int, height: F4, led: F4, asked: U1, top: np.float32, bit: int, out: U1
) -> None:
    """Set a bit on the pixels of some rows whose ray to an LED, in px and mm, is blocked.

    Only pixels that are `asked` are tested; a ray ends above `top`.
    """
    for row in range(first, last):
        for column in range(height.shape[1]):
            if asked[row, column] and _is_blocked(height, led, top, row, column):
                out[row, column] |= np.uint8(bit)


@compiled
def _is_blocked(height: F4, led: F4, top: np.float32, row: int, column: int) -> bool:
    rows, columns = height.shape
    x, y, z = np.float32(column), np.float32(row), height[row, column]
    right, bottom = np.float32(columns - 1), np.float32(rows - 1)
    dx, dy = led[0] - (x - right * HALF), led[1] - (y - bottom * HALF)
    plan = np.sqrt(dx * dx + dy * dy) + TINY
    ux, uy, climb = dx / plan, dy / plan, (led[2] - z) / plan
    t, farthest = STEP, np.float32(rows + columns)
    while t < farthest:
        px, py, ray = x + ux * t, y + uy * t, z + climb * t
        if not (px >= 0 and px <= right and py >= 0 and py <= bottom):
            return False
        if _bilinear(height, px, py) > ray:
            return True
        if not ray < top:
            return False
        t += STEP
    return False


@compiled
def march(
    rays: Rays, film: LedFilm, dark: U1, step: np.float32, longest: float, end: F4, edge: F4
) -> None:
    """Enter the distances along each ray, in px, of the shadow's end and its casting edge."""
    rows, columns = dark.shape
    for ray in range(rays.row.size):
        x, y, ux, uy = rays.column[ray], rays.row[ray], rays.ux[ray], rays.uy[ray]
        before = _lit_share(film, int(y), int(x))
        t = step
        while t <= longest:
            px, py = x + ux * t, y + uy * t
            if not (px >= 0 and px <= columns - 1 and py >= 0 and py <= rows - 1):
                break
            if t - step < FARTHEST_END:
                now = _share_between(film, px, py)
                if now < HALF and before >= HALF:
                    back = step * (HALF - now) / max(before - now, TINY)
                    end[ray] = min(max(t - back, ZERO), FARTHEST_END)
                before = now
            if t > NEAREST_EDGE and _bilinear(dark, px, py) < HALF:
                edge[ray] = t
                break
            t += step


@compiled
def _share_between(film: LedFilm, x: np.float32, y: np.float32) -> np.float32:
    """The share of its light that film between pixels gets from an LED."""
    rows, columns = film.light.shape
    upper, lower, v = _weights(rows, y)
    left, right, u = _weights(columns, x)
    above = _lit_share(film, upper, left) * (ONE - u) + _lit_share(film, upper, right) * u
    below = _lit_share(film, lower, left) * (ONE - u) + _lit_share(film, lower, right) * u
    return above * (ONE - v) + below * v


@compiled
def _lit_share(film: LedFilm, row: int, column: int) -> np.float32:
    """The share (0 to 1) of its light that a pixel gets from an LED (equation N1)."""
    p, q = film.slope[0, row, column], film.slope[1, row, column]
    lx, ly, lz = film.led
    dx, dy, dz = lx - film.x[column], ly - film.y[row], lz - film.height[row, column]
    plan = dx * dx + dy * dy
    nearer = (plan + lz * lz) / (plan + dz * dz)
    gain = nearer * np.sqrt(nearer) * (ONE / lz)
    expected = (dz * gain - p * (dx * gain) - q * (dy * gain)) / np.sqrt(ONE + p * p + q * q)
    return min(max(film.light[row, column] / max(expected, FAINTEST), ZERO), ONE)
