"""The loops of `label_lights` over pixels, compiled by numba.

Rows are processed in pieces: first all pixels as if every LED reached them, then, for each other
set of LEDs, the pixels that it may explain better.  The innermost loops go over the pixels of a
piece, so that LLVM vectorises them.

LLVM must see that planes do not overlap.  So planes that belong together are one array, in which
x, y and z lie `PIECE` apart, and numba inlines functions of single pixels.

Importing numba takes half a second, so this is imported where the host labels.

Long because one node is one algorithm: each set of LEDs is solved, judged and compared.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4
from tactograph.nodes._compiled import NOTHING, compiled, inlined
from tactograph.nodes.shadow._pieces import PIECE

if TYPE_CHECKING:
    from tactograph.nodes.shadow._pieces import Choice, Images, Pixels, Room
    from tactograph.nodes.shadow.label_lights import Labelled, Rules

Vector = tuple[np.float32, np.float32, np.float32]
Symmetric = tuple[np.float32, np.float32, np.float32, np.float32, np.float32, np.float32]
"""The elements xx, xy, xz, yy, yz, zz of a matrix."""

Y, Z = PIECE, 2 * PIECE
"""Distances of the y and z of vectors from their x."""
XY, XZ, YY, YZ, ZZ, BX, BY, BZ = (PIECE * number for number in range(1, 9))
"""Where sums lie, behind those of xx."""
FLATTEST = np.float32(0.02)
"""Smallest n_z of a normal: the camera sees no steeper film."""
LONGEST = np.float32(0.3)
"""Longest Gauss-Newton step, in radians."""
AT_REST = np.float32(0.999)
"""A pair's normal with a larger n_z is the film at rest: two lights are not 1 by accident."""
ALIKE = np.float32(0.02)
"""Smallest difference of the dark LEDs' light that decides between a pair's two normals."""
MILD = np.float32(0.01)
"""Variance of a normal, over n_z^2, up to which the bias by noise is fully corrected."""
SINGULAR = np.float32(1e-4)
"""Sine squared of the angle between two lights' gradients below which they count as one."""
FAINTEST = np.float32(0.08)
"""Lower bound on the expected light, of which a shadow has less than half."""
STRAY = np.float32(0.015)
"""Light in a shadow that is no noise: from the film, and ambient light not fully subtracted."""
SHADE = np.float32(0.1)
"""Light that is bright for a shadow.  Without this, two dark LEDs could explain any pixel as lit
at a grazing angle, and the bright LEDs as shadows of still brighter light."""
UNKNOWN = np.float32(1e12)
BEHIND = np.float32(0.05)
"""The camera cannot see normals with a smaller n_z."""
PLENTY = np.float32(10)
SOFTLY, LEAST_SPREAD, LEAST_PAIR = np.float32(1e-6), np.float32(1e-5), np.float32(1e-9)
ZERO, HALF, ONE, TINY = np.float32(0), np.float32(0.5), np.float32(1), np.float32(1e-20)
INFINITE = np.float32(np.inf)


@compiled
def label(
    first: int, last: int, images: Images, prior: F4, rules: Rules, room: Room, made: Labelled
) -> None:
    """Label some rows."""
    columns, most = images.x.size, room.best.cost.size
    for row in range(first, last):
        for start in range(0, columns, most):
            count = min(most, columns - start)
            load(images, row, start, count, room.pixels)
            _find_dark(prior, rules, row, start, count, room.pixels)
            _label_piece(rules, room, count)
            _write(rules, room, row, start, count, made)


@compiled
def load(images: Images, row: int, start: int, count: int, pixels: Pixels) -> None:
    """Read the light of a piece of a row, and find the light vectors there (equation N1)."""
    end = start + count
    x, z = images.x[start:end], images.height[row, start:end]
    for k in range(len(images.lights)):
        lx, ly, lz = images.lights[k]
        dy = ly - images.y[row]
        light, sigma = images.light[k, row, start:end], images.sigma[k, row, start:end]
        v, m, spread, weight = pixels.vectors[k], pixels.light[k], pixels.sigma[k], pixels.weight[k]
        for i in range(count):
            dx, dz = lx - x[i], lz - z[i]
            plan = dx * dx + dy * dy
            nearer = (plan + lz * lz) / (plan + dz * dz)
            gain = nearer * np.sqrt(nearer) * (ONE / lz)
            v[i], v[i + Y], v[i + Z] = dx * gain, dy * gain, dz * gain
        for i in range(count):
            m[i] = light[i]
            spread[i] = max(sigma[i], LEAST_SPREAD)
            weight[i] = ONE / (spread[i] * spread[i])


@compiled
def _find_dark(prior: F4, rules: Rules, row: int, start: int, count: int, pixels: Pixels) -> None:
    """Read the expected slopes, and find the LEDs that certainly do not reach."""
    p, q, forced = prior[0, row, start:], prior[1, row, start:], pixels.forced
    for i in range(count):
        pixels.prior[i], pixels.prior[i + Y], forced[i] = p[i], q[i], np.uint8(0)
    for k in range(len(pixels.light)):
        light, spread, below = pixels.light[k], pixels.sigma[k], pixels.below[k]
        bit = np.uint8(1 << k if rules.dark > 0 else 0)
        for i in range(count):
            dark = light[i] < rules.floor * spread[i]
            below[i] = dark
            forced[i] |= bit if dark else np.uint8(0)


@compiled
def _label_piece(rules: Rules, room: Room, count: int) -> None:
    """Find the cheapest set for each pixel; none where no set is allowed."""
    pixels, best, tried, doubtful = room.pixels, room.best, room.tried, room.doubtful
    _try(pixels, count, rules.sets[0], rules, room, best)
    left = NOTHING
    for i in range(count):
        # Leaving an LED out costs at least its price.
        if pixels.forced[i] == 0 and best.cost[i] <= rules.price:
            continue
        doubtful[left] = i
        left += 1
        if pixels.forced[i] != 0 or not best.cost[i] < INFINITE:
            _forget(best, i)
    if left == 0:
        return
    for left_out in rules.sets[1:]:
        chosen = _choose(rules, room, left, left_out)
        if chosen == 0:
            continue
        _try(room.chosen, chosen, left_out, rules, room, tried)
        for j in range(chosen):
            i = room.where[j]
            if tried.cost[j] < best.cost[i]:
                for axis in (0, Y, Z):
                    best.normal[i + axis] = tried.normal[j + axis]
                    best.twin[i + axis] = tried.twin[j + axis]
                best.used[i], best.cost[i] = tried.used[j], tried.cost[j]
                best.misfit[i] = tried.misfit[j]


@compiled
def _forget(best: Choice, i: int) -> None:
    """Reset a pixel: no set explains it yet."""
    for axis in (0, Y, Z):
        best.normal[i + axis] = best.twin[i + axis] = ONE if axis == Z else ZERO
    best.used[i], best.cost[i], best.misfit[i] = np.uint8(0), INFINITE, ZERO


@compiled
def _choose(rules: Rules, room: Room, left: int, left_out: int) -> int:
    """Gather the pixels that a set may explain better; return how many they are."""
    pixels, chosen = room.pixels, room.chosen
    leds, number = len(pixels.light), _count_bits(left_out)
    price = rules.price * np.float32(number)
    found = 0
    for n in range(left):
        i = room.doubtful[n]
        forced = np.int64(pixels.forced[i])
        if forced & ~left_out or _count_bits(forced) + rules.dark < number:
            continue
        # A lower bound on the cost: the light of LEDs left out counts whatever the normal is.
        least = price
        for k in range(leds):
            if left_out >> k & 1 and not pixels.below[k, i]:
                much = pixels.light[k, i] * (ONE / SHADE)
                least += much * much
        if not room.best.cost[i] > least:
            continue
        room.where[found] = i
        chosen.forced[found] = pixels.forced[i]
        chosen.prior[found], chosen.prior[found + Y] = pixels.prior[i], pixels.prior[i + Y]
        for k in range(leds):
            chosen.light[k, found] = pixels.light[k, i]
            chosen.sigma[k, found] = pixels.sigma[k, i]
            chosen.weight[k, found] = pixels.weight[k, i]
            chosen.below[k, found] = pixels.below[k, i]
            for axis in (0, Y, Z):
                chosen.vectors[k, found + axis] = pixels.vectors[k, i + axis]
        found += 1
    return found


@compiled
def _count_bits(number: int) -> int:
    count = 0
    while number:
        count += number & 1
        number >>= 1
    return count


@compiled
def _try(
    pixels: Pixels, count: int, left_out: int, rules: Rules, room: Room, tried: Choice
) -> None:
    """Solve for the normal without some LEDs, and find what that costs."""
    leds = len(pixels.light)
    number = leds - _count_bits(left_out)
    if number > 2:
        add_up(pixels, count, left_out, room.sums)
        _least_squares(count, rules.uneven, room.sums, tried.normal, tried.twin)
    else:
        _pair(pixels, count, left_out, rules, room, tried)
    judged = tried.normal
    if number == 3:
        judged = room.judged
        _least_squares_of_three(count, room.sums, judged)
    _judge(pixels, count, left_out, judged, rules, room.sums, tried)
    used = np.uint8(~left_out & ((1 << leds) - 1))
    for i in range(count):
        tried.used[i] = used


@compiled
def add_up(pixels: Pixels, count: int, left_out: int, sums: F4) -> None:
    """Sums of w v v' (xx, xy, xz, yy, yz, zz) and of w m v."""
    for i in range(sums.size):
        sums[i] = ZERO
    for k in range(len(pixels.light)):
        if left_out >> k & 1:
            continue
        v, weight, light = pixels.vectors[k], pixels.weight[k], pixels.light[k]
        for i in range(count):
            x, y, z = v[i], v[i + Y], v[i + Z]
            wx, wy, wz = x * weight[i], y * weight[i], z * weight[i]
            sums[i] += wx * x
            sums[i + XY] += wx * y
            sums[i + XZ] += wx * z
            sums[i + YY] += wy * y
            sums[i + YZ] += wy * z
            sums[i + ZZ] += wz * z
            sums[i + BX] += wx * light[i]
            sums[i + BY] += wy * light[i]
            sums[i + BZ] += wz * light[i]


@compiled
def _least_squares(count: int, uneven: np.float32, sums: F4, normal: F4, twin: F4) -> None:
    """The unit normals that sets of three LEDs or more give, at any brightness of the film."""
    square = uneven * uneven
    for i in range(count):
        a, b, scale = _scaled(sums, i)
        n = _visible(_unit(_solved(a, b)))
        # The equations near n, less what the brightness explains.
        along = _times(a, n)
        share = square / (scale + square * _dot(n, along))
        x, y, z = along[0] * share, along[1] * share, along[2] * share
        lit = _dot(n, b)
        less = (
            a[0] - x * along[0], a[1] - x * along[1], a[2] - x * along[2],
            a[3] - y * along[1], a[4] - y * along[2], a[5] - z * along[2],
        )  # fmt: skip
        free = b[0] - x * lit, b[1] - y * lit, b[2] - z * lit
        given = _unit(_visible(_gauss_newton(less, free, scale, n)))
        normal[i], normal[i + Y], normal[i + Z] = given
        twin[i], twin[i + Y], twin[i + Z] = given


@compiled
def _least_squares_of_three(count: int, sums: F4, judged: F4) -> None:
    """The unit normals by which sets of three are judged: only |n| = 1 can reveal a shadow."""
    for i in range(count):
        a, b, scale = _scaled(sums, i)
        n = _visible(_unit(_solved(a, b)))
        given = _unit(_visible(_gauss_newton(a, b, scale, n)))
        judged[i], judged[i + Y], judged[i + Z] = given


@inlined
def _scaled(sums: F4, i: int) -> tuple[Symmetric, Vector, np.float32]:
    """A pixel's equations, divided by the trace of their matrix so that products stay small."""
    xx, yy, zz = sums[i], sums[i + YY], sums[i + ZZ]
    scale = ONE / (xx + yy + zz)
    xy, xz, yz = sums[i + XY] * scale, sums[i + XZ] * scale, sums[i + YZ] * scale
    b = sums[i + BX] * scale, sums[i + BY] * scale, sums[i + BZ] * scale
    return (xx * scale, xy, xz, yy * scale, yz, zz * scale), b, scale


@inlined
def _dot(a: Vector, b: Vector) -> np.float32:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def _unit(n: Vector) -> Vector:
    shorter = ONE / (np.sqrt(_dot(n, n)) + TINY)
    return n[0] * shorter, n[1] * shorter, n[2] * shorter


@inlined
def _visible(n: Vector) -> Vector:
    """A normal that the camera can see."""
    return n[0], n[1], max(n[2], FLATTEST)


@inlined
def _times(a: Symmetric, b: Vector) -> Vector:
    """A symmetric matrix times a vector."""
    xx, xy, xz, yy, yz, zz = a
    return (
        xx * b[0] + xy * b[1] + xz * b[2],
        xy * b[0] + yy * b[1] + yz * b[2],
        xz * b[0] + yz * b[1] + zz * b[2],
    )


@inlined
def _solved(a: Symmetric, b: Vector) -> Vector:
    """Direction of the solution of a symmetric 3 x 3 system, by the adjugate."""
    xx, xy, xz, yy, yz, zz = a
    c00, c01, c02 = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    c11, c12, c22 = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    return _times((c00, c01, c02, c11, c12, c22), b)


@inlined
def _gauss_newton(a: Symmetric, b: Vector, scale: np.float32, n: Vector) -> Vector:
    """One step in the tangent plane, n + s (n_z, 0, -n_x) + t (0, n_z, -n_y).

    The step corrects the bias of the slope by noise.  With h = T'AT in the tangents T,
    u = T'An, f = h^-1 u, G = T'T and noise of covariance C = scale h^-1, a step from the linear
    solution goes too far by C (G f) + f tr(C G) / 2 on average, which off the axis of the
    LEDs turns the film at rest into a bowl.  Also, p and q come out too large by C (p, q).
    """
    xx, xy, xz, yy, yz, zz = a
    x, y, z = n
    # The matrix times the first tangent, and the part of the second's product that is needed.
    ux, uy, uz = xx * z - xz * x, xy * z - yz * x, xz * z - zz * x
    vy, vz = yy * z - yz * y, yz * z - zz * y
    h11, h12, h22 = ux * z - uz * x, uy * z - uz * y, vy * z - vz * y
    trace = h11 + h22
    inverse = ONE / (h11 * h22 - h12 * h12 + SOFTLY * trace * trace + TINY)
    g11, g12, g22 = z * z + x * x, x * y, z * z + y * y
    spread = scale * inverse * (h22 * g11 + h11 * g22 - (h12 + h12) * g12)
    limit = MILD * z * z
    mild = limit / max(spread, limit)
    half, scale = HALF * mild * spread, mild * scale
    ax, ay, az = _times(a, n)
    u1, u2 = ax * z - az * x, ay * z - az * y
    f1, f2 = (h22 * u1 - h12 * u2) * inverse, (h11 * u2 - h12 * u1) * inverse
    g1 = b[0] * z - b[2] * x - u1 - half * u1 - scale * (g11 * f1 + g12 * f2 + x / z)
    g2 = b[1] * z - b[2] * y - u2 - half * u2 - scale * (g12 * f1 + g22 * f2 + y / z)
    s, t = (h22 * g1 - h12 * g2) * inverse, (h11 * g2 - h12 * g1) * inverse
    shrink = LONGEST / max(np.sqrt(s * s + t * t), LONGEST)
    s, t = s * shrink, t * shrink
    return x + s * z, y + t * z, z - s * x - t * y


@compiled
def _pair(
    pixels: Pixels, count: int, left_out: int, rules: Rules, room: Room, tried: Choice
) -> None:
    """The two unit normals that two LEDs allow, the likelier first."""
    first, second, sums = tried.normal, tried.twin, room.sums
    _two_normals(pixels, count, left_out, first, second)
    for i in range(count):
        sums[i] = PLENTY if first[i + Z] < BEHIND else ZERO
        sums[i + Y] = PLENTY if second[i + Z] < BEHIND else ZERO
    for k in range(len(pixels.light)):
        if not left_out >> k & 1:
            continue
        v = pixels.vectors[k]
        for i in range(count):
            sums[i] += max(lit_by(v, first, i), ZERO)
            sums[i + Y] += max(lit_by(v, second, i), ZERO)
    for i in range(count):
        a = first[i], first[i + Y], first[i + Z]
        b = second[i], second[i + Y], second[i + Z]
        if rules.by_prior:
            believed = -pixels.prior[i], -pixels.prior[i + Y], ONE
            take = _dot(a, believed) >= _dot(b, believed)
        elif abs(sums[i] - sums[i + Y]) < ALIKE:
            take = a[2] >= b[2]
        else:
            take = sums[i] < sums[i + Y]
        if max(a[2], b[2]) > AT_REST:
            take = a[2] >= b[2]
        if not take:
            a, b = b, a
        first[i], first[i + Y], first[i + Z] = _visible(a)
        second[i], second[i + Y], second[i + Z] = _visible(b)


@compiled
def _two_normals(pixels: Pixels, count: int, left_out: int, first: F4, second: F4) -> None:
    """Unit n with n.v_i = m_i and n.v_j = m_j; the nearest, twice, where noise leaves none."""
    i = j = -1
    for k in range(len(pixels.light)):
        if not left_out >> k & 1:
            i, j = j, k
    u, v, of_i, of_j = pixels.vectors[i], pixels.vectors[j], pixels.light[i], pixels.light[j]
    for c in range(count):
        a, b = (u[c], u[c + Y], u[c + Z]), (v[c], v[c + Y], v[c + Z])
        cross_x, cross_y = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2]
        cross_z = a[0] * b[1] - a[1] * b[0]
        aa, ab, bb = _dot(a, a), _dot(a, b), _dot(b, b)
        determinant = max(aa * bb - ab * ab, LEAST_PAIR)
        s = (bb * of_i[c] - ab * of_j[c]) / determinant
        t = (aa * of_j[c] - ab * of_i[c]) / determinant
        base = a[0] * s + b[0] * t, a[1] * s + b[1] * t, a[2] * s + b[2] * t
        beyond = np.sqrt(max(ONE - _dot(base, base), ZERO) / determinant)
        x, y, z = cross_x * beyond, cross_y * beyond, cross_z * beyond
        found = _unit((base[0] + x, base[1] + y, base[2] + z))
        first[c], first[c + Y], first[c + Z] = found
        found = _unit((base[0] - x, base[1] - y, base[2] - z))
        second[c], second[c + Y], second[c + Z] = found


@compiled
def _judge(
    pixels: Pixels, count: int, left_out: int, n: F4, rules: Rules, sums: F4, tried: Choice
) -> None:
    """The sum of squares of the residuals, at any brightness for more than three LEDs; and the
    cost of the set, including the LEDs left out."""
    leds, number = len(pixels.light), _count_bits(left_out)
    cost, misfit = tried.cost, tried.misfit
    price = rules.price * np.float32(number)
    for i in range(3 * PIECE):
        sums[i] = ZERO
    for i in range(count):
        cost[i] = price
    for k in range(leds):
        v, light = pixels.vectors[k], pixels.light[k]
        if left_out >> k & 1:
            sigma, below = pixels.sigma[k], pixels.below[k]
            for i in range(count):
                over = light[i] - max(lit_by(v, n, i), ZERO)
                spread = np.sqrt(sigma[i] * sigma[i] + STRAY * STRAY)
                bright = max(over / spread + rules.one_sided, ZERO)
                lit = light[i] * (ONE / SHADE)
                cost[i] += ZERO if below[i] else bright * bright + lit * lit
        else:
            _add_squares(v, n, light, pixels.weight[k], count, sums)
    square = rules.uneven * rules.uneven if leds - number > 3 else ZERO
    for i in range(count):
        along, whole = sums[i + Y], sums[i + Z]
        misfit[i] = sums[i] - square / (ONE + square * whole) * along * along
        cost[i] += misfit[i]


@inlined
def lit_by(v: F4, n: F4, i: int) -> np.float32:
    """The light that a normal gets from an LED."""
    return v[i] * n[i] + v[i + Y] * n[i + Y] + v[i + Z] * n[i + Z]


@compiled
def _add_squares(v: F4, n: F4, light: F4, weight: F4, count: int, sums: F4) -> None:
    """Add an LED's squared residual, its product with the expected light, and that squared."""
    for i in range(count):
        expected = lit_by(v, n, i)
        away, weighted = light[i] - expected, weight[i] * expected
        sums[i] += weight[i] * away * away
        sums[i + Y] += weighted * away
        sums[i + Z] += weighted * expected


@compiled
def _write(rules: Rules, room: Room, row: int, start: int, count: int, made: Labelled) -> None:
    """Enter the wanted outputs of a piece of a row."""
    best = room.best
    _write_slope(best.normal, rules.steepest, row, start, count, made.slope)
    _write_slope(best.twin, rules.steepest, row, start, count, made.twin)
    if made.variance.size:
        _write_variance(rules, room, row, start, count, made.variance)
    if made.used.size:
        for i in range(count):
            made.used[row, start + i] = best.used[i]
    if made.shadow.size:
        _write_shadow(room.pixels, best, row, start, count, made.shadow)
    if made.misfit.size:
        for i in range(count):
            made.misfit[row, start + i] = best.misfit[i]


@compiled
def _write_slope(n: F4, steepest: np.float32, row: int, start: int, count: int, made: F4) -> None:
    if made.size == 0:
        return
    p, q = made[0, row, start : start + count], made[1, row, start : start + count]
    for i in range(count):
        flatter = -ONE / max(n[i + Z], ONE / steepest)
        p[i], q[i] = n[i] * flatter, n[i + Y] * flatter


@compiled
def _write_shadow(
    pixels: Pixels, best: Choice, row: int, start: int, count: int, made: NDArray[np.uint8]
) -> None:
    """The LEDs whose light is missing; where the slope is not known, those below the floor."""
    n = best.normal
    out, used = made[row, start : start + count], best.used
    for i in range(count):
        out[i] = pixels.forced[i] if used[i] == 0 else np.uint8(0)
    for k in range(len(pixels.light)):
        v = pixels.vectors[k]
        light, bit = pixels.light[k], np.uint8(1 << k)
        for i in range(count):
            expected = max(lit_by(v, n, i), FAINTEST)
            dim = (light[i] < HALF * expected) & (used[i] != 0) & (used[i] & bit == 0)
            out[i] |= bit if dim else np.uint8(0)


@compiled
def _write_variance(rules: Rules, room: Room, row: int, start: int, count: int, made: F4) -> None:
    """(J' W J)^-1 of the tangent plane, carried to p and q.

    d(p, q) = -((1 + p^2, p q), (p q, 1 + q^2)) d(a, b).
    """
    pixels, used, n, sums = room.pixels, room.best.used, room.best.normal, room.sums
    for i in range(sums.size):
        sums[i] = ZERO
    for k in range(len(pixels.light)):
        v, weight, bit = pixels.vectors[k], pixels.weight[k], np.uint8(1 << k)
        for i in range(count):
            counts = used[i] & bit != 0
            w = weight[i] if counts else ZERO
            j1 = v[i] * n[i + Z] - v[i + Z] * n[i]
            j2 = v[i + Y] * n[i + Z] - v[i + Z] * n[i + Y]
            shown = lit_by(v, n, i)
            sums[i] += w * j1 * j1
            sums[i + XY] += w * j1 * j2
            sums[i + YY] += w * j2 * j2
            sums[i + BX] += w * shown * j1
            sums[i + BY] += w * shown * j2
            sums[i + BZ] += w * shown * shown
            sums[i + ZZ] += ONE if counts else ZERO
    of_p, of_q = made[0, row, start : start + count], made[1, row, start : start + count]
    square = rules.uneven * rules.uneven
    for i in range(count):
        u1, u2 = sums[i + BX], sums[i + BY]
        share = square / (ONE + square * sums[i + BZ]) if sums[i + ZZ] > 2 else ZERO
        h11, h12 = sums[i] - share * u1 * u1, sums[i + XY] - share * u1 * u2
        h22 = sums[i + YY] - share * u2 * u2
        determinant = h11 * h22 - h12 * h12
        known = determinant > SINGULAR * h11 * h22
        flatter = -ONE / max(n[i + Z], ONE / rules.steepest)
        p, q = n[i] * flatter, n[i + Y] * flatter
        a, b, c = ONE + p * p, p * q, ONE + q * q
        by_p = (a * a * h22 - a * b * h12 - a * b * h12 + b * b * h11) / determinant
        by_q = (b * b * h22 - b * c * h12 - b * c * h12 + c * c * h11) / determinant
        of_p[i] = by_p if known else UNKNOWN
        of_q[i] = by_q if known else UNKNOWN
