"""The loops of `height_error` over pixels, compiled by numba: what errors do to slopes and steps.

Row after row, and in a row LED after LED, so that all of a row stays in the cache.

Importing numba takes half a second, so this is imported where the host needs it (`_springs`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tactograph.nodes import F4, U1
from tactograph.nodes._compiled import compiled, inlined

if TYPE_CHECKING:
    from tactograph.nodes.height._slope_errors import Error, Response, Turns, Unperturbed

ZERO, THIRD, HALF, ONE, THREE = map(np.float32, (0, 1 / 3, 0.5, 1, 3))
SINGULAR = np.float32(1e-4)
LEAST_VARIANCE = np.float32(1e-10)
LEAST_NOISE = np.float32(1e-12)
STEEPEST = np.float32(3)
TILTED = np.float32(0.1)
"""Slope from which on the model's error is that of the presses."""
FLAT = np.float32(0.3)
"""Share of that error on level film around a touch.  There the flat frame cancels it, except for
the light that the touch throws on the film."""


@compiled
def respond(
    first: int,
    last: int,
    film: Unperturbed,
    lights: F4,
    used: U1,
    rest: U1,
    uneven: np.float32,
    flat_noise: np.float32,
    shared: np.float32,
    made: Response,
) -> None:
    """Enter the response of some rows.

    The derivative of the weighted least-squares normal by the lights, transformed to p and q, in
    the tangent plane n + a (n_z, 0, -n_x) + b (0, n_z, -n_y).  For three LEDs or more the film's
    brightness is free; see `label_lights`.
    """
    leds, width = len(lights), film.x.size
    room = np.empty((4, leds, width), np.float32)
    along_a, along_b, weight, lit = room[0], room[1], room[2], room[3]
    for row in range(first, last):
        p, q, z = film.slope[0, row], film.slope[1, row], film.height[row]
        whole, with_a, with_b, counts, aa, ab, bb = np.zeros((7, width), np.float32)
        for k in range(leds):
            lx, ly, lz = lights[k]
            dy = ly - film.y[row]
            a, b, w, shown = along_a[k], along_b[k], weight[k], lit[k]
            sigma, labels, by = film.sigma[k, row], used[row], made.by_place[k]
            for c in range(width):
                dx, dz = lx - film.x[c], lz - z[c]
                plan = dx * dx + dy * dy
                nearer = (plan + lz * lz) / (plan + dz * dz)
                gain = nearer * np.sqrt(nearer) * (ONE / lz)
                vx, vy, vz = dx * gain, dy * gain, dz * gain
                nz = ONE / np.sqrt(ONE + p[c] * p[c] + q[c] * q[c])
                shown[c] = (vz - vx * p[c] - vy * q[c]) * nz
                a[c], b[c] = (vx + vz * p[c]) * nz, (vy + vz * q[c]) * nz
                counted = np.float32((labels[c] >> k) & 1)
                w[c] = counted / max(sigma[c] * sigma[c], LEAST_VARIANCE)
                there, here = ONE / (plan + lz * lz), ONE / (plan + dz * dz)
                thrice, apart, sunk = THREE * shown[c], there - here, gain * nz
                by[0, row, c] = thrice * dx * apart - sunk * p[c]
                by[1, row, c] = thrice * dy * apart - sunk * q[c]
                by[2, row, c] = thrice * (lz * there - dz * here - THIRD / lz) + sunk
                weighted = w[c] * shown[c]
                whole[c] += weighted * shown[c]
                with_a[c] += weighted * a[c]
                with_b[c] += weighted * b[c]
                counts[c] += counted
        square = uneven * uneven
        for k in range(leds):
            a, b, w, shown = along_a[k], along_b[k], weight[k], lit[k]
            for c in range(width):
                share = square / (ONE + square * whole[c]) if counts[c] > 2 else ZERO
                told_a = w[c] * (a[c] - share * with_a[c] * shown[c])
                told_b = w[c] * (b[c] - share * with_b[c] * shown[c])
                aa[c] += told_a * a[c]
                ab[c] += told_a * b[c]
                bb[c] += told_b * b[c]
                a[c], b[c] = told_a, told_b
        at_rest = rest[row]
        pp, pq, qq = np.zeros((3, width), np.float32)
        for k in range(leds):
            a, b, by_p, by_q = along_a[k], along_b[k], made.by_p[k, row], made.by_q[k, row]
            sigma, light = film.sigma[k, row], film.light[k, row]
            for c in range(width):
                determinant = aa[c] * bb[c] - ab[c] * ab[c]
                known = (determinant > SINGULAR * aa[c] * bb[c]) & (at_rest[c] == 0)
                inverse = ONE / determinant if known else ZERO
                by_a = (bb[c] * a[c] - ab[c] * b[c]) * inverse
                by_b = (aa[c] * b[c] - ab[c] * a[c]) * inverse
                by_p[c] = -((ONE + p[c] * p[c]) * by_a + p[c] * q[c] * by_b)
                by_q[c] = -(p[c] * q[c] * by_a + (ONE + q[c] * q[c]) * by_b)
                flat = flat_noise * light[c]
                noise = shared * sigma[c] * np.sqrt(ONE + flat * flat)
                noise_p, noise_q = by_p[c] * noise, by_q[c] * noise
                pp[c] += noise_p * noise_p
                pq[c] += noise_p * noise_q
                qq[c] += noise_q * noise_q
        alone, along, across = made.alone[row], made.along[row], made.across[row]
        for c in range(width):
            alone[c] = np.sqrt(pp[c])
            along[c] = pq[c] / max(alone[c], LEAST_NOISE)
            across[c] = np.sqrt(max(qq[c] - along[c] * along[c], ZERO))


@compiled
def err(
    film: Unperturbed,
    response: Response,
    error: Error,
    turns: Turns,
    pixel: np.float32,
    steps: Turns,
) -> None:
    """Enter in `steps` what an error adds to the steps to the right and down, in mm."""
    rows, width = film.height.shape
    p, q, before = np.empty((3, width), np.float32)
    half = HALF * pixel
    for row in range(rows):
        _err_slopes(film, response, error, row, p, q)
        if error.of_columns.size:
            _lean(film, error, row, p, q)
        right, turned, start = steps.right[row], turns.right[row], np.uint32(row * width)
        for c in range(width - 1):
            drawn = _draw(np.uint32(start + np.uint32(c)) ^ error.right_key)
            right[c] = (p[c + 1] + p[c]) * half + turned[c] * drawn
        if row > 0:
            down, turned = steps.down[row - 1], turns.down[row - 1]
            start = np.uint32((row - 1) * width)
            for c in range(width):
                drawn = _draw(np.uint32(start + np.uint32(c)) ^ error.down_key)
                down[c] = (q[c] + before[c]) * half + turned[c] * drawn
        before, q = q, before


@compiled
def _err_slopes(
    film: Unperturbed, response: Response, error: Error, row: int, p: F4, q: F4
) -> None:
    """The error of the slopes in a row due to the errors of the lights."""
    rows, width = film.height.shape
    change = np.empty(width, np.float32)
    for c in range(width):
        p[c], q[c] = ZERO, ZERO
    for k in range(len(error.moved)):
        right, down, up = error.moved[k]
        # Row by row: numba does not know that the rows of a slice are contiguous.
        by_right, by_down = response.by_place[k, 0, row], response.by_place[k, 1, row]
        by_up = response.by_place[k, 2, row]
        for c in range(width):
            change[c] = right * by_right[c] + down * by_down[c] + up * by_up[c]
        if film.bounced.size:
            bounced = film.bounced[k, row]
            for c in range(width):
                change[c] += error.bounce * bounced[c]
        if film.changed.size:
            changed = film.changed[k, row]
            for c in range(width):
                change[c] += error.settling * changed[c]
        by_p, by_q = response.by_p[k, row], response.by_q[k, row]
        for c in range(width):
            p[c] += by_p[c] * change[c]
            q[c] += by_q[c] * change[c]
    alone, along, across = response.alone[row], response.along[row], response.across[row]
    start, other = np.uint32(row * width), np.uint32((rows + row) * width)
    for c in range(width):
        first = _draw(np.uint32(start + np.uint32(c)) ^ error.light_key)
        second = _draw(np.uint32(other + np.uint32(c)) ^ error.light_key)
        p[c] += alone[c] * first
        q[c] += along[c] * first + across[c] * second
    for c in range(width):
        p[c], q[c] = _bounded(p[c]), _bounded(q[c])


@compiled
def _lean(film: Unperturbed, error: Error, row: int, p: F4, q: F4) -> None:
    """Add to the slopes of a row the lean of the normals by the model's error."""
    slope_p, slope_q = film.slope[0, row], film.slope[1, row]
    cosine, sine = error.of_columns[0], error.of_columns[1]
    row_cosine, row_sine = error.of_rows[0, row], error.of_rows[1, row]
    for c in range(p.size):
        a, b = slope_p[c], slope_q[c]
        square = a * a + b * b
        slant = np.sqrt(square)
        tilted = min(max(slant / TILTED, FLAT), ONE)
        lean = tilted * (cosine[c] * row_cosine - sine[c] * row_sine)
        steeper = error.steeper / max(slant, TILTED)
        along = lean * (error.across * a + error.down * b) + steeper * (ONE + square)
        p[c] = _bounded(p[c] + lean * error.across + along * a)
        q[c] = _bounded(q[c] + lean * error.down + along * b)


@inlined
def _bounded(slope: np.float32) -> np.float32:
    return min(max(slope, -STEEPEST), STEEPEST)


@inlined
def _draw(number: np.uint32) -> np.float32:
    """+1 or -1 by a hash, as `drawn` does for whole planes."""
    x = np.uint32((number ^ (number >> np.uint32(16))) * np.uint32(0x7FEB352D))
    x = np.uint32((x ^ (x >> np.uint32(15))) * np.uint32(0x846CA68B))
    x = np.uint32(x ^ (x >> np.uint32(16)))
    return -ONE if x >> np.uint32(31) == 0 else ONE
