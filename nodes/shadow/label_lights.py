"""Tell for each pixel which LEDs light it, and find its slope from those.

Long because one node is one algorithm: each set of LEDs is solved, judged and compared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Interval
from numpy.typing import NDArray

from tactograph.graph import EVERYTHING, Flips, Port, SizeLimit, Wanted, node
from tactograph.nodes import (
    F4,
    Height,
    Labels,
    Light,
    LightPositions,
    PixelSize,
    Slope,
    SlopeVariance,
    Uneven,
)
from tactograph.nodes.light._cache_blocks import in_blocks
from tactograph.nodes.light._near_light import FLATTEST, brightness_share, places, vectors_at

LONGEST = np.float32(0.3)
"""Longest Gauss-Newton step, in radians."""
AT_REST = np.float32(0.999)
"""A pair's normal with a larger n_z is the film at rest: light says 1 twice by no accident."""
ALIKE = np.float32(0.02)
"""Light of the dark LEDs that decides between the two normals of a pair."""
MILD = np.float32(0.01)
"""Variance of a normal, over n_z^2, up to which what noise does on average is taken out."""
SINGULAR = np.float32(1e-4)
"""Sine squared of the angle between two lights' gradients below which they are one."""
FAINTEST = np.float32(0.08)
"""Light that is expected at least, when what is there is called less than half of it."""
STRAY = np.float32(0.015)
"""Light in a shadow that is no noise: the film's own, and ambient light not quite taken off."""
SHADE = np.float32(0.1)
"""Light that is much for a shadow.  Two dark LEDs alone would explain any pixel as lit at a
grazing angle, and the bright ones as shadows of still brighter light."""
UNKNOWN = np.float32(1e12)
ONE, ZERO, TINY = np.float32(1), np.float32(0), np.float32(1e-20)


class Labelled(NamedTuple):
    """A slope for each pixel, and what it rests on."""

    slope: Slope
    twin: Slope
    variance: SlopeVariance
    used: Labels
    shadow: Labels
    misfit: Annotated[F4, Port("H W", "1")]


class _Rules(NamedTuple):
    """The node's parameters."""

    pair: str
    dark: int
    floor: np.float32
    price: np.float32
    one_sided: np.float32
    steepest: np.float32
    uneven: np.float32


class _Pixels(NamedTuple):
    """N pixels: light, its standard deviation and weight K x N, vectors K x 3 x N, the prior
    slope 2 x N, and the LEDs that surely do not reach (K x N, and as bits where that counts).
    """

    light: F4
    sigma: F4
    weight: F4
    vectors: F4
    prior: F4
    below: NDArray[np.bool_]
    forced: NDArray[np.uint8]

    def at(self, where: NDArray[np.intp]) -> _Pixels:
        parts: Iterator[Any] = (part[..., where] for part in self)
        return _Pixels(*parts)


class _Choice(NamedTuple):
    """The best so far per pixel: normals 3 x N, the LEDs used, and what the choice costs."""

    normal: F4
    twin: F4
    used: NDArray[np.uint8]
    cost: F4
    misfit: F4


@node(
    tolerance=Flips(
        2e-3, 2e-3, 2e-3, why="sets of LEDs that explain a pixel equally well, nearly singular sets"
    ),
    sizes={"K": SizeLimit(3, 8, "two LEDs leave two slopes, a label has 8 bits")},
)
def label_lights(
    light: Light,
    sigma: Light,
    lights: LightPositions,
    height: Height,
    prior: Slope,
    pixel: PixelSize,
    uneven: Uneven,
    *,
    pair: Literal["prior", "attached"] = "attached",
    dark: Annotated[int, Interval(ge=0, le=2)] = 2,
    floor: Annotated[float, Ge(0)] = 3.0,
    price: Annotated[float, Ge(0)] = 12.0,
    one_sided: float = 2.0,
    steepest: Annotated[float, Gt(0)] = 30.0,
    wanted: Wanted = EVERYTHING,
) -> Labelled:
    """Return the slope and the LEDs that explain a pixel's light best.

    The light relative to the film at rest is n.v_k with |n| = 1 (`_near_light`, N1), where
    LED k reaches.  An LED below ``floor`` standard deviations does not.  Of the sets of the
    others without none, one or two of them, the one of least

        sum over used ((m_k - n.v_k) / sigma_k)^2 + price (LEDs left out)
        + sum over left out max((m_k - n.v_k) / spread_k + one_sided, 0)^2 + (m_k / 0.1)^2

    wins: a shadow costs, and has to be dark, though none is quite black: spread_k is sigma_k
    and 1.5 % of the film's light.  Three LEDs or more give n by linear least
    squares, scaled to |n| = 1, and a Gauss-Newton step in the tangent plane; two give the
    two unit normals that fit exactly.

    Film brightens where it is touched, unevenly, and for all LEDs alike.  So the light of
    three LEDs or more has an unknown factor of the standard deviation ``uneven``: the normal
    follows from how the LEDs compare.  More than three are judged so, too.  Three alone are
    judged by |n| = 1, which is all that shows a shadow among them.

    Parameters
    ----------
    light, sigma
        K x H x W, relative to the film at rest, and its standard deviation.
    lights
        K x 3 in mm from the middle of the image.
    height
        H x W in mm, as far as known: light comes from another direction higher up.
    prior
        2 x H x W, the slope expected; for ``pair: prior`` only.
    pixel
        mm per px.
    uneven
        Standard deviation of the film's brightness, as a share.
    pair
        What decides between a pair's two normals, unless one is the film at rest:
        ``prior`` the nearer to the prior; ``attached`` the one that puts the dark LEDs
        behind the surface, else the less steep.
    dark
        So many LEDs are left out at most, beyond those below the floor; with 0 all count as
        lit, also those.
    floor
        Light in standard deviations below which an LED surely does not reach.
    price
        Of leaving out an LED, as a square of standard deviations.
    one_sided
        Standard deviations by which a shadow is darker than the light predicted.
    steepest
        Largest slope returned, as 1 / n_z.

    Returns
    -------
    Labelled
        Slope 2 x H x W, zero where fewer than two LEDs reach; the twin that a pair of LEDs
        allows too (else the slope again); the variance of the slope from that of the light,
        1e12 where not known; bit k-1 of ``used`` where the slope rests on LED k, of
        ``shadow`` where LED k does not light the pixel (not used, and less than half of
        what the slope predicts); the misfit, the choice's sum of squares.
    """
    rules = _Rules(pair, dark, *map(np.float32, (floor, price, one_sided, steepest, uneven)))
    images = tuple(image.reshape(*image.shape[:-2], -1) for image in (light, sigma, height, prior))
    x, y = _places(height.shape, pixel)
    sizes = {"H": 1, "W": height.size}
    made: dict[str, NDArray[Any]] = {
        name: np.empty(label_lights.output_shape(name, sizes), port.dtype)
        for name, port in label_lights.outputs.items()
        if name in wanted
    }

    def pixels_of(part: slice | NDArray[np.intp]) -> _Pixels:
        here_light, here_sigma, z, here_prior = (image[..., part] for image in images)
        vectors = vectors_at(lights, x[part], y[part], z)
        return _pixels(here_light, here_sigma, vectors, here_prior, rules)

    def all_lit(part: slice) -> NDArray[np.intp]:
        """Take every LED to reach; return the pixels that another set may explain better."""
        pixels = pixels_of(part)
        best = _try(pixels, 0, rules)
        _write(made, part, pixels, best, rules)
        # Leaving an LED out costs its price at least.
        return part.start + np.flatnonzero((pixels.forced != 0) | ~(best.cost <= rules.price))

    def any_set(part: NDArray[np.intp]) -> None:
        pixels = pixels_of(part)
        _write(made, part, pixels, _best(pixels, rules), rules)

    doubtful = np.concatenate(in_blocks(all_lit, height.size))
    in_blocks(lambda part: any_set(doubtful[part]), doubtful.size)
    for name, plane in made.items():
        made[name] = plane.reshape(*plane.shape[:-2], *height.shape)
    planes: Iterator[Any] = map(made.get, Labelled._fields)
    return Labelled(*planes)


label_lights.opencl(grid="H W", lanes="grid")


@label_lights.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """LEDs around the film, and noise that is neither none nor all."""
    azimuth = (np.arange(K) + rng.uniform(-0.2, 0.2, K)) * 2 * np.pi / K
    reach, z = rng.uniform(20, 40, K), rng.uniform(30, 60, K)
    lights = np.column_stack([reach * np.cos(azimuth), reach * np.sin(azimuth), z])
    sigma = rng.uniform(0.005, 0.02, (K, H, W))
    return {"lights": lights.astype(np.float32), "sigma": sigma.astype(np.float32)}


def _places(shape: tuple[int, ...], pixel: float) -> tuple[F4, F4]:
    """The x and y of every pixel in mm from the middle, row after row."""
    rows, columns = shape
    x, y = places(columns, np.float32(pixel)), places(rows, np.float32(pixel))
    return np.tile(x, rows), np.repeat(y, columns)


def _pixels(light: F4, sigma: F4, vectors: F4, prior: F4, rules: _Rules) -> _Pixels:
    spread = np.maximum(sigma, np.float32(1e-5))
    below = light < rules.floor * spread
    forced = _bits(below & (rules.dark > 0))
    weight = np.asarray(ONE / (spread * spread), np.float32)
    return _Pixels(light, spread, weight, vectors, prior, below, forced)


def _write(
    made: Mapping[str, NDArray[Any]],
    part: slice | NDArray[np.intp],
    pixels: _Pixels,
    best: _Choice,
    rules: _Rules,
) -> None:
    """Enter what is wanted of some pixels."""
    found: dict[str, Callable[[], NDArray[Any]]] = {
        "slope": lambda: _slope(best.normal, rules),
        "twin": lambda: _slope(best.twin, rules),
        "variance": lambda: _variance(pixels, best, rules),
        "used": lambda: best.used,
        "shadow": lambda: _shadow(pixels, best),
        "misfit": lambda: best.misfit,
    }
    for name, plane in made.items():
        plane[..., 0, part] = found[name]()


def _best(pixels: _Pixels, rules: _Rules) -> _Choice:
    """The cheapest set for each pixel; none where no set is open."""
    size = pixels.forced.size
    level = np.zeros((3, size), np.float32)
    level[2] = 1
    worst = np.full(size, np.inf, np.float32)
    best = _Choice(level, level.copy(), np.zeros(size, np.uint8), worst, np.zeros_like(worst))
    most = np.bitwise_count(pixels.forced) + np.uint8(rules.dark)
    for left_out in _sets(len(pixels.light)):
        number = left_out.bit_count()
        open_ = (pixels.forced & ~np.uint8(left_out) == 0) & (most >= number)
        least = rules.price * np.float32(number) + _light_of(pixels, left_out)
        where = np.flatnonzero(open_ & (best.cost > least))
        if where.size:
            _keep_better(best, _try(pixels.at(where), left_out, rules), where)
    return best


def _light_of(pixels: _Pixels, left_out: int) -> F4:
    """What a set of LEDs left out costs at least: their light is much for a shadow, wherever the
    surface faces.  An LED below the floor is dark."""
    total = np.zeros(pixels.light.shape[1], np.float32)
    for k, light in enumerate(pixels.light):
        if left_out >> k & 1:
            much = light * (ONE / SHADE)
            total += np.where(pixels.below[k], ZERO, much * much)
    return total


def _bits(flags: NDArray[np.bool_]) -> NDArray[np.uint8]:
    numbers = np.arange(len(flags), dtype=np.uint8)[:, None]
    return np.asarray(np.bitwise_or.reduce(flags.astype(np.uint8) << numbers, axis=0), np.uint8)


def _sets(count: int) -> Iterator[int]:
    """The sets of LEDs that may be left out, small ones first; two LEDs stay."""
    sets = [s for s in range(1 << count) if s.bit_count() <= count - 2]
    yield from sorted(sets, key=lambda s: (s.bit_count(), s))


def _try(pixels: _Pixels, left_out: int, rules: _Rules) -> _Choice:
    """Solve for the normal without some LEDs, and say what that costs."""
    count, size = pixels.light.shape
    used = [k for k in range(count) if not left_out >> k & 1]
    if len(used) > 2:
        judged, normal = _least_squares(pixels, used, rules.uneven)
        twin = normal
    else:
        normal, twin = _pair(pixels, used, left_out, rules.pair)
        judged = normal
    misfit = _squares(pixels, used, judged, rules.uneven)
    cost = misfit + rules.price * np.float32(left_out.bit_count())
    for k in set(range(count)) - set(used):
        over = pixels.light[k] - np.maximum(_dot(pixels.vectors[k], judged), ZERO)
        spread = np.sqrt(pixels.sigma[k] * pixels.sigma[k] + STRAY * STRAY)
        bright = np.maximum(over / spread + rules.one_sided, ZERO)
        lit = pixels.light[k] * (ONE / SHADE)
        cost += np.where(pixels.below[k], ZERO, bright * bright + lit * lit)
    labels = np.full(size, ~left_out & (1 << count) - 1, np.uint8)
    return _Choice(normal, twin, labels, cost, misfit)


def _squares(pixels: _Pixels, used: list[int], normal: F4, uneven: np.float32) -> F4:
    """The sum of squares that a normal leaves; of more than three LEDs at any brightness."""
    squares, along, whole = np.zeros((3, normal.shape[1]), np.float32)
    for k in used:
        expected = _dot(pixels.vectors[k], normal)
        away, weighted = pixels.light[k] - expected, pixels.weight[k] * expected
        squares += pixels.weight[k] * away * away
        along += weighted * away
        whole += weighted * expected
    if len(used) > 3:
        squares -= brightness_share(whole, ONE, uneven) * along * along
    return squares


def _keep_better(best: _Choice, tried: _Choice, where: NDArray[np.intp]) -> None:
    better = tried.cost < best.cost[where]
    for name in _Choice._fields:
        getattr(best, name)[..., where[better]] = getattr(tried, name)[..., better]


def _dot(a: F4, b: F4 | tuple[F4, F4, np.float32]) -> F4:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2], np.float32)


def _unit(n: F4) -> F4:
    return n * (ONE / (np.sqrt(_dot(n, n)) + TINY))


def _visible(n: F4) -> F4:
    """Normals that the camera can see; changes n."""
    np.maximum(n[2], FLATTEST, out=n[2])
    return n


def _least_squares(pixels: _Pixels, used: list[int], uneven: np.float32) -> tuple[F4, F4]:
    """The unit normal that judges a set of three LEDs or more, and the one that it gives."""
    a, b, scale = _normal_equations(pixels, used)
    linear = _visible(_unit(_solve(a, b)))
    free = _at_any_brightness(a, b, scale, linear, uneven)
    normal = _unit(_visible(_gauss_newton(*free, scale, linear)))
    if len(used) > 3:
        return normal, normal
    return _unit(_visible(_gauss_newton(a, b, scale, linear))), normal


def _at_any_brightness(a: F4, b: F4, scale: F4, n: F4, uneven: np.float32) -> tuple[F4, F4]:
    """The normal equations near n, less what the film's brightness explains."""
    along = _times(a, n)
    taken = along * brightness_share(_dot(n, along), scale, uneven)
    less = np.empty_like(a)
    for row, (i, j) in enumerate(((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))):
        np.subtract(a[row], taken[i] * along[j], out=less[row])
    return less, b - taken * _dot(n, b)


def _normal_equations(pixels: _Pixels, used: list[int]) -> tuple[F4, F4, F4]:
    """Sums of w v v' and of w m v, times the last, one over the trace of the first: so products
    stay small."""
    a = np.zeros((6, pixels.light.shape[1]), np.float32)
    b = np.zeros((3, a.shape[1]), np.float32)
    for k in used:
        v = pixels.vectors[k]
        weighted = v * pixels.weight[k]
        a[:3] += weighted[0] * v
        a[3:5] += weighted[1] * v[1:]
        a[5] += weighted[2] * v[2]
        b += weighted * pixels.light[k]
    scale = ONE / (a[0] + a[3] + a[5])
    a *= scale
    b *= scale
    return a, b, scale


def _solve(a: F4, b: F4) -> F4:
    """Direction of the solution of a symmetric 3 x 3 system, by the adjugate."""
    xx, xy, xz, yy, yz, zz = a
    c00, c01, c02 = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    c11, c12, c22 = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    return _times((c00, c01, c02, c11, c12, c22), b)


def _times(a: F4 | tuple[F4, ...], b: F4) -> F4:
    """A symmetric matrix times a vector."""
    xx, xy, xz, yy, yz, zz = a
    rows = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    made = np.empty_like(b)
    for row, out in zip(rows, made, strict=True):
        np.add(row[0] * b[0] + row[1] * b[1], row[2] * b[2], out=out)
    return made


def _gauss_newton(a: F4, b: F4, scale: F4, n: F4) -> F4:
    """One step in the tangent plane, n + s (n_z, 0, -n_x) + t (0, n_z, -n_y).

    To a slope that noise does not bias.  With h = T'AT in the tangents T, u = T'An,
    f = h^-1 u, G = T'T and noise of covariance C = scale h^-1, such a step from the linear
    solution goes too far by C (G f) + f tr(C G) / 2 on average, which off the axis of the
    LEDs makes a bowl of the film at rest; and p and q come out too large by C (p, q).
    """
    xx, xy, xz, yy, yz, zz = a
    x, y, z = n
    # The matrix times the first tangent, and what the second takes of its own product.
    ux, uy, uz = xx * z - xz * x, xy * z - yz * x, xz * z - zz * x
    vy, vz = yy * z - yz * y, yz * z - zz * y
    h11, h12, h22 = ux * z - uz * x, uy * z - uz * y, vy * z - vz * y
    trace = h11 + h22
    inverse = ONE / (h11 * h22 - h12 * h12 + np.float32(1e-6) * trace * trace + TINY)
    g11, g12, g22 = z * z + x * x, x * y, z * z + y * y
    spread = scale * inverse * (h22 * g11 + h11 * g22 - (h12 + h12) * g12)
    limit = MILD * z * z
    mild = limit / np.maximum(spread, limit)
    half, scale = np.float32(0.5) * mild * spread, mild * scale
    ax, ay, az = _times(a, n)
    u1, u2 = ax * z - az * x, ay * z - az * y
    f1, f2 = (h22 * u1 - h12 * u2) * inverse, (h11 * u2 - h12 * u1) * inverse
    g1 = b[0] * z - b[2] * x - u1 - half * u1 - scale * (g11 * f1 + g12 * f2 + x / z)
    g2 = b[1] * z - b[2] * y - u2 - half * u2 - scale * (g12 * f1 + g22 * f2 + y / z)
    s, t = (h22 * g1 - h12 * g2) * inverse, (h11 * g2 - h12 * g1) * inverse
    shrink = LONGEST / np.maximum(np.sqrt(s * s + t * t), LONGEST)
    s, t = s * shrink, t * shrink
    return np.stack([x + s * z, y + t * z, z - s * x - t * y])


def _pair(pixels: _Pixels, used: list[int], left_out: int, pair: str) -> tuple[F4, F4]:
    """The two unit normals that two LEDs allow, the likelier first."""
    first, second = _two_normals(pixels, *used)
    if pair == "prior":
        p, q = pixels.prior
        believed = -p, -q, ONE
        take = _dot(first, believed) >= _dot(second, believed)
    else:
        dark = [k for k in range(len(pixels.light)) if left_out >> k & 1]
        lit = _lit_behind(pixels, dark, first), _lit_behind(pixels, dark, second)
        alike = np.abs(lit[0] - lit[1]) < ALIKE
        take = np.where(alike, first[2] >= second[2], lit[0] < lit[1])
    level = np.maximum(first[2], second[2]) > AT_REST
    take = np.where(level, first[2] >= second[2], take)
    chosen, other = np.where(take, first, second), np.where(take, second, first)
    chosen[2], other[2] = np.maximum(chosen[2], FLATTEST), np.maximum(other[2], FLATTEST)
    return chosen, other


def _two_normals(pixels: _Pixels, i: int, j: int) -> tuple[F4, F4]:
    """Unit n with n.v_i = m_i and n.v_j = m_j; the nearest, twice, where noise leaves none."""
    a, b = pixels.vectors[i], pixels.vectors[j]
    cross = np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
    aa, ab, bb = _dot(a, a), _dot(a, b), _dot(b, b)
    determinant = np.maximum(aa * bb - ab * ab, np.float32(1e-9))
    s = (bb * pixels.light[i] - ab * pixels.light[j]) / determinant
    t = (aa * pixels.light[j] - ab * pixels.light[i]) / determinant
    base = a * s + b * t
    beyond = np.sqrt(np.maximum(ONE - _dot(base, base), ZERO) / determinant)
    return _unit(base + cross * beyond), _unit(base - cross * beyond)


def _lit_behind(pixels: _Pixels, dark: list[int], n: F4) -> F4:
    """The light that LEDs called dark would give; plenty for a normal the camera cannot see."""
    total = np.where(n[2] < np.float32(0.05), np.float32(10), ZERO)
    for k in dark:
        total += np.maximum(_dot(pixels.vectors[k], n), ZERO)
    return total


def _slope(n: F4, rules: _Rules) -> F4:
    flatter = np.float32(-1) / np.maximum(n[2], ONE / rules.steepest)
    return n[:2] * flatter


def _shadow(pixels: _Pixels, best: _Choice) -> NDArray[np.uint8]:
    """The LEDs whose light is not there; where the slope is not known, those below the floor."""
    if (best.used == (1 << len(pixels.light)) - 1).all():
        return np.zeros_like(best.used)
    dim = []
    for k, plane in enumerate(pixels.light):
        expected = np.maximum(_dot(pixels.vectors[k], best.normal), FAINTEST)
        dim.append(plane < np.float32(0.5) * expected)
    return np.where(best.used == 0, pixels.forced, _bits(np.stack(dim)) & ~best.used)


def _variance(pixels: _Pixels, best: _Choice, rules: _Rules) -> F4:
    """(J' W J)^-1 of the tangent plane, carried to p and q.

    d(p, q) = -((1 + p^2, p q), (p q, 1 + q^2)) d(a, b).
    """
    n = best.normal
    h11, h12, h22, u1, u2, whole = np.zeros((6, n.shape[1]), np.float32)
    for k, v in enumerate(pixels.vectors):
        w = np.where(best.used >> k & 1, pixels.weight[k], ZERO)
        j1, j2 = v[0] * n[2] - v[2] * n[0], v[1] * n[2] - v[2] * n[1]
        h11, h12, h22 = h11 + w * j1 * j1, h12 + w * j1 * j2, h22 + w * j2 * j2
        shown = _dot(v, n)
        u1, u2, whole = u1 + w * shown * j1, u2 + w * shown * j2, whole + w * shown * shown
    share = np.where(
        np.bitwise_count(best.used) > 2, brightness_share(whole, ONE, rules.uneven), ZERO
    )
    h11, h12, h22 = h11 - share * u1 * u1, h12 - share * u1 * u2, h22 - share * u2 * u2
    determinant = h11 * h22 - h12 * h12
    known = determinant > SINGULAR * h11 * h22
    determinant = np.where(known, determinant, ONE)
    p, q = _slope(n, rules)
    a, b, c = ONE + p * p, p * q, ONE + q * q
    by_p = (a * a * h22 - 2 * a * b * h12 + b * b * h11) / determinant
    by_q = (b * b * h22 - 2 * b * c * h12 + c * c * h11) / determinant
    return np.where(known, np.stack([by_p, by_q]), UNKNOWN).astype(np.float32)
