"""The set of LEDs that explains a pixel best, and its slope: ``label_lights.cl`` for the host.

Loops over pixels are innermost and without branches, so that several are done at once;
`nodes/shadow/label_lights.py` says what is done, and why.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from tactograph.graph.backends.numba import inlined

F4 = np.float32
STEPS = 1
LONGEST = F4(0.3)
AT_REST = F4(0.999)
ALIKE = F4(0.02)
MILD = F4(0.01)
SINGULAR = F4(1e-4)
FAINTEST = F4(0.08)
FLATTEST = F4(0.02)
STRAY = F4(0.015)
SHADE = F4(0.1)
UNKNOWN = F4(1e12)
INFINITE = F4(np.inf)
ZERO, HALF, ONE, TWO, TINY = F4(0), F4(0.5), F4(1), F4(2), F4(1e-20)

N = 128
"""Pixels side by side, few enough for the fastest cache."""


class Pixels(NamedTuple):
    """Parts of a block of which each column is a pixel: what is known of it, and the best so far.

    Under each LED the light, its standard deviation and weight, 1 where that LED surely does
    not reach, and the vector of equation N1 in three rows.  The prior slope, the column in the
    image, and how many LEDs are left out at most.  The normals, the LEDs used, the cost.
    """

    light: Any
    spread: Any
    weight: Any
    below: Any
    vector: Any
    prior: Any
    column: Any
    most: Any
    normal: Any
    twin: Any
    used: Any
    cost: Any
    misfit: Any


class Made(NamedTuple):
    """What comes of the pixels: parts of a block, or the node's outputs."""

    slope: Any
    twin: Any
    variance: Any
    used: Any
    shadow: Any
    misfit: Any


def label_lights(K: int) -> Callable[..., None]:
    """Return the function for K LEDs."""
    known = 7 * K + 13

    def label_lights(
        light, sigma, lights, height, prior, pixel,
        slope, twin, variance, used, shadow, misfit,
        pair, dark, floor, price, one_sided, steepest, first, last,
    ):  # fmt: skip
        W = light.shape[2]
        # One block, as wide as is known here: the compiler sees that no two rows overlap.
        block = np.empty((known + 7, N), F4)
        pixels = pixels_in(K, block)
        made = made_of(pixels, block[known:])
        wanted = Made(slope, twin, variance, used, shadow, misfit)
        lit = np.empty(K, F4)
        for row in range(first, last):
            for left in range(0, W, N):
                count = min(N, W - left)
                load(
                    K, pixels, count, light, sigma, lights, height, prior, pixel,
                    dark, floor, row, left,
                )  # fmt: skip
                number = 0
                while count and number <= K - 2:
                    for out in range(1 << K):
                        if bits(out) == number:
                            try_set(K, pixels, count, out, lit, pair, price, one_sided)
                    make(K, pixels, made, count, wanted, steepest)
                    put(pixels, made, count, wanted, row)
                    number += 1
                    count = keep_open(block[:known], pixels, count, number, price)

    return label_lights


@inlined
def pixels_in(K, block):
    rest = block[7 * K :]
    return Pixels(
        light=block[:K],
        spread=block[K : 2 * K],
        weight=block[2 * K : 3 * K],
        below=block[3 * K : 4 * K],
        vector=block[4 * K : 7 * K],
        prior=rest[:2],
        column=rest[2],
        most=rest[3],
        normal=rest[4:7],
        twin=rest[7:10],
        used=rest[10],
        cost=rest[11],
        misfit=rest[12],
    )


@inlined
def made_of(pixels, block):
    return Made(
        slope=block[:2],
        twin=block[2:4],
        variance=block[4:6],
        used=pixels.used,
        shadow=block[6],
        misfit=pixels.misfit,
    )


@inlined
def load(
    K, pixels, count, light, sigma, lights, height, prior, pixel, dark, floor, row, left
):  # fmt: skip
    """Enter some pixels of a row, and no choice yet."""
    _, H, W = light.shape
    y = (F4(row) - HALF * F4(H - 1)) * pixel
    for i in range(count):
        column = left + i
        x, z = (F4(column) - HALF * F4(W - 1)) * pixel, height[row, column]
        number = ZERO
        for k in range(K):
            spread = larger(F4(1e-5), sigma[k, row, column])
            below = ONE if dark and light[k, row, column] < floor * spread else ZERO
            pixels.light[k, i] = light[k, row, column]
            pixels.spread[k, i] = spread
            pixels.weight[k, i] = ONE / (spread * spread)
            pixels.below[k, i] = below
            number += below
            lx, ly, lz = lights[k, 0], lights[k, 1], lights[k, 2]
            dx, dy, dz = lx - x, ly - y, lz - z
            plan = dx * dx + dy * dy
            nearer = (plan + lz * lz) / (plan + dz * dz)
            gain = nearer * np.sqrt(nearer) * (ONE / lz)
            pixels.vector[3 * k, i] = dx * gain
            pixels.vector[3 * k + 1, i] = dy * gain
            pixels.vector[3 * k + 2, i] = dz * gain
        pixels.most[i] = number + F4(dark)
        pixels.column[i] = F4(column)
        pixels.normal[0, i] = pixels.normal[1, i] = ZERO
        pixels.twin[0, i] = pixels.twin[1, i] = ZERO
        pixels.normal[2, i] = pixels.twin[2, i] = ONE
        pixels.used[i] = pixels.misfit[i] = ZERO
        pixels.cost[i] = INFINITE
    for i in range(count):
        pixels.prior[0, i] = prior[0, row, left + i]
        pixels.prior[1, i] = prior[1, row, left + i]


@inlined
def keep_open(block, pixels, count, number, price):
    """Move the pixels that may do better without so many LEDs to the front; return how many."""
    kept = 0
    for i in range(count):
        # Leaving LEDs out costs their price at least.
        if pixels.most[i] >= F4(number) and pixels.cost[i] > price * F4(number):
            for row in range(len(block)):
                block[row, kept] = block[row, i]
            kept += 1
    return kept


@inlined
def try_set(K, pixels, count, out, lit, pair, price, one_sided):
    """Solve for the normals without some LEDs, and keep them where that costs less."""
    for k in range(K):
        lit[k] = ZERO if out >> k & 1 else ONE
    number = bits(out)
    labels, least = F4(((1 << K) - 1) & ~out), price * F4(number)
    if number < K - 2:
        for i in range(count):
            n = least_squares(K, pixels, lit, i)
            keep(K, pixels, i, n, n, labels, F4(number), lit, least, one_sided)
    else:
        a, b = ends(K, out)
        for i in range(count):
            n, twin = pair_of(K, pixels, lit, a, b, pair, i)
            keep(K, pixels, i, n, twin, labels, F4(number), lit, least, one_sided)


@inlined
def keep(K, pixels, i, normal, twin, labels, number, lit, least, one_sided):
    """Take normals for the best if they cost less, and no LED that they need surely is dark."""
    misfit, excess, missing = ZERO, ZERO, ZERO
    for k in range(K):
        light = pixels.light[k, i]
        predicted = dot(vector_of(pixels, k, i), normal)
        away = light - predicted
        misfit += lit[k] * pixels.weight[k, i] * away * away
        spread = np.sqrt(pixels.spread[k, i] * pixels.spread[k, i] + STRAY * STRAY)
        bright = larger(ZERO, (light - larger(ZERO, predicted)) / spread + one_sided)
        much = light * (ONE / SHADE)
        unlike = (ONE - lit[k]) * (ONE - pixels.below[k, i])
        excess += unlike * (bright * bright + much * much)
        missing += lit[k] * pixels.below[k, i]
    cost = misfit + least + excess
    open_ = (missing == ZERO) & (pixels.most[i] >= number) & (pixels.cost[i] > least)
    better = open_ & (cost < pixels.cost[i])
    put_better(pixels.normal, i, better, normal)
    put_better(pixels.twin, i, better, twin)
    pixels.used[i] = labels if better else pixels.used[i]
    pixels.misfit[i] = misfit if better else pixels.misfit[i]
    pixels.cost[i] = cost if better else pixels.cost[i]


@inlined
def put_better(kept, i, better, n):
    kept[0, i] = n[0] if better else kept[0, i]
    kept[1, i] = n[1] if better else kept[1, i]
    kept[2, i] = n[2] if better else kept[2, i]


@inlined
def bits(number):
    count = 0
    while number:
        number &= number - 1
        count += 1
    return count


@inlined
def ends(K, out):
    """The first and the last LED that is not left out."""
    first, last = -1, -1
    for k in range(K):
        if not out >> k & 1:
            first = k if first < 0 else first
            last = k
    return first, last


@inlined
def larger(low, value):
    return low if low > value else value


@inlined
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def scaled(a, by):
    return a[0] * by, a[1] * by, a[2] * by


@inlined
def combined(a, s, b, t):
    return a[0] * s + b[0] * t, a[1] * s + b[1] * t, a[2] * s + b[2] * t


@inlined
def chosen_of(first, a, b):
    return a[0] if first else b[0], a[1] if first else b[1], a[2] if first else b[2]


@inlined
def unit(n):
    return scaled(n, ONE / (np.sqrt(dot(n, n)) + TINY))


@inlined
def visible(n):
    return n[0], n[1], larger(FLATTEST, n[2])


@inlined
def times(a, b):
    """A symmetric matrix times a vector."""
    xx, xy, xz, yy, yz, zz = a
    x, y, z = b
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z


@inlined
def vector_of(pixels, k, i):
    return pixels.vector[3 * k, i], pixels.vector[3 * k + 1, i], pixels.vector[3 * k + 2, i]


@inlined
def solution(a, b):
    """Direction of the solution of a symmetric 3 x 3 system, by the adjugate."""
    xx, xy, xz, yy, yz, zz = a
    c00, c01, c02 = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    c11, c12, c22 = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    return times((c00, c01, c02, c11, c12, c22), b)


@inlined
def least_squares(K, pixels, lit, i):
    """The unit normal from three LEDs or more."""
    xx = xy = xz = yy = yz = zz = bx = by = bz = ZERO
    for k in range(K):
        x, y, z = vector_of(pixels, k, i)
        wx, wy, wz = scaled((x, y, z), lit[k] * pixels.weight[k, i])
        light = pixels.light[k, i]
        xx += wx * x
        xy += wx * y
        xz += wx * z
        yy += wy * y
        yz += wy * z
        zz += wz * z
        bx += wx * light
        by += wy * light
        bz += wz * light
    scale = ONE / (xx + yy + zz)
    a = (xx * scale, xy * scale, xz * scale, yy * scale, yz * scale, zz * scale)
    b = (bx * scale, by * scale, bz * scale)
    normal = visible(unit(solution(a, b)))
    for _ in range(STEPS):
        normal = unit(visible(gauss_newton(a, b, scale, normal)))
    return normal


@inlined
def gauss_newton(a, b, scale, n):
    """One step in the tangent plane, n + s (n_z, 0, -n_x) + t (0, n_z, -n_y)."""
    xx, xy, xz, yy, yz, zz = a
    x, y, z = n
    # The matrix times the first tangent, and what the second takes of its own product.
    ux, uy, uz = xx * z - xz * x, xy * z - yz * x, xz * z - zz * x
    vy, vz = yy * z - yz * y, yz * z - zz * y
    h11, h12, h22 = ux * z - uz * x, uy * z - uz * y, vy * z - vz * y
    trace = h11 + h22
    inverse = ONE / (h11 * h22 - h12 * h12 + F4(1e-6) * trace * trace + TINY)
    g11, g12, g22 = z * z + x * x, x * y, z * z + y * y
    spread = scale * inverse * (h22 * g11 + h11 * g22 - (h12 + h12) * g12)
    limit = MILD * z * z
    mild = limit / larger(spread, limit)
    half, part, steep = HALF * mild * spread, mild * scale, ONE / z
    ax, ay, az = times(a, n)
    u1, u2 = ax * z - az * x, ay * z - az * y
    f1, f2 = (h22 * u1 - h12 * u2) * inverse, (h11 * u2 - h12 * u1) * inverse
    g1 = b[0] * z - b[2] * x - u1 - half * u1 - part * (g11 * f1 + g12 * f2 + x * steep)
    g2 = b[1] * z - b[2] * y - u2 - half * u2 - part * (g12 * f1 + g22 * f2 + y * steep)
    s, t = (h22 * g1 - h12 * g2) * inverse, (h11 * g2 - h12 * g1) * inverse
    shrink = LONGEST / larger(LONGEST, np.sqrt(s * s + t * t))
    s, t = s * shrink, t * shrink
    return x + s * z, y + t * z, z - s * x - t * y


@inlined
def pair_of(K, pixels, lit, j, k, pair, i):
    """The two unit normals that LEDs j and k allow, the likelier first."""
    u, v = vector_of(pixels, j, i), vector_of(pixels, k, i)
    across = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
    uu, uv, vv = dot(u, u), dot(u, v), dot(v, v)
    determinant = larger(F4(1e-9), uu * vv - uv * uv)
    s = (vv * pixels.light[j, i] - uv * pixels.light[k, i]) / determinant
    t = (uu * pixels.light[k, i] - uv * pixels.light[j, i]) / determinant
    base = combined(u, s, v, t)
    beyond = np.sqrt(larger(ZERO, ONE - dot(base, base)) / determinant)
    first = unit(combined(base, ONE, across, beyond))
    second = unit(combined(base, ONE, across, -beyond))
    flatter = first[2] >= second[2]
    believed = -pixels.prior[0, i], -pixels.prior[1, i], ONE
    nearer = dot(first, believed) >= dot(second, believed)
    a, b = lit_behind(K, pixels, lit, first, i), lit_behind(K, pixels, lit, second, i)
    darker = flatter if abs(a - b) < ALIKE else a < b
    take = darker if pair else nearer
    take = flatter if larger(first[2], second[2]) > AT_REST else take
    return visible(chosen_of(take, first, second)), visible(chosen_of(take, second, first))


@inlined
def lit_behind(K, pixels, lit, n, i):
    """The light that LEDs called dark would give; plenty for a normal the camera cannot see."""
    total = F4(10) if n[2] < F4(0.05) else ZERO
    for k in range(K):
        total += (ONE - lit[k]) * larger(ZERO, dot(vector_of(pixels, k, i), n))
    return total


@inlined
def make(K, pixels, made, count, wanted, steepest):
    """What is wanted of the best choices."""
    for i in range(count):
        n = pixels.normal[0, i], pixels.normal[1, i], pixels.normal[2, i]
        made.slope[0, i], made.slope[1, i] = slope_of(n, steepest)
    if wanted.twin.size:
        for i in range(count):
            n = pixels.twin[0, i], pixels.twin[1, i], pixels.twin[2, i]
            made.twin[0, i], made.twin[1, i] = slope_of(n, steepest)
    if wanted.variance.size:
        for i in range(count):
            made.variance[0, i], made.variance[1, i] = variance_of(K, pixels, made, i)
    if wanted.shadow.size:
        for i in range(count):
            made.shadow[i] = shadow_of(K, pixels, i)


@inlined
def slope_of(n, steepest):
    flatter = -ONE / larger(ONE / steepest, n[2])
    return n[0] * flatter, n[1] * flatter


@inlined
def variance_of(K, pixels, made, i):
    """(J' W J)^-1 of the tangent plane, carried to p and q."""
    n = pixels.normal[0, i], pixels.normal[1, i], pixels.normal[2, i]
    used = np.int32(pixels.used[i])
    h11 = h12 = h22 = ZERO
    for k in range(K):
        v = vector_of(pixels, k, i)
        w = pixels.weight[k, i] if used & 1 << k else ZERO
        j1, j2 = v[0] * n[2] - v[2] * n[0], v[1] * n[2] - v[2] * n[1]
        h11 += w * j1 * j1
        h12 += w * j1 * j2
        h22 += w * j2 * j2
    determinant = h11 * h22 - h12 * h12
    known = determinant > SINGULAR * h11 * h22
    p, q = made.slope[0, i], made.slope[1, i]
    a, b, c = ONE + p * p, p * q, ONE + q * q
    by_p = (a * a * h22 - TWO * a * b * h12 + b * b * h11) / determinant
    by_q = (b * b * h22 - TWO * b * c * h12 + c * c * h11) / determinant
    return by_p if known else UNKNOWN, by_q if known else UNKNOWN


@inlined
def shadow_of(K, pixels, i):
    """The LEDs whose light is not there; where the slope is not known, those below the floor."""
    n = pixels.normal[0, i], pixels.normal[1, i], pixels.normal[2, i]
    used = np.int32(pixels.used[i])
    dim, forced = ZERO, ZERO
    for k in range(K):
        bit = F4(1 << k)
        due = larger(FAINTEST, dot(vector_of(pixels, k, i), n))
        dark = pixels.light[k, i] < HALF * due and not used & 1 << k
        dim += bit if dark else ZERO
        forced += bit * pixels.below[k, i]
    return dim if used else forced


@inlined
def put(pixels, made, count, wanted, row):
    """Write what is wanted to where it belongs."""
    for i in range(count):
        at = int(pixels.column[i])
        for axis in range(2):
            if wanted.slope.size:
                wanted.slope[axis, row, at] = made.slope[axis, i]
            if wanted.twin.size:
                wanted.twin[axis, row, at] = made.twin[axis, i]
            if wanted.variance.size:
                wanted.variance[axis, row, at] = made.variance[axis, i]
        if wanted.used.size:
            wanted.used[row, at] = np.uint8(made.used[i])
        if wanted.shadow.size:
            wanted.shadow[row, at] = np.uint8(made.shadow[i])
        if wanted.misfit.size:
            wanted.misfit[row, at] = made.misfit[i]
