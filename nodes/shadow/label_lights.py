"""Find which LEDs light each pixel, and from their light its slope."""

from __future__ import annotations

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
from tactograph.nodes.light._near_light import brightness_share, places, vectors_at

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
ZERO, HALF, ONE, TINY = np.float32(0), np.float32(0.5), np.float32(1), np.float32(1e-20)


class Labelled(NamedTuple):
    """A slope for each pixel, and what it rests on."""

    slope: Slope
    twin: Slope
    variance: SlopeVariance
    used: Labels
    shadow: Labels
    misfit: Annotated[F4, Port("H W", "1")]


class Pixels(NamedTuple):
    """N pixels: light, its standard deviation and weight, the LEDs below the floor (each K x N),
    the vectors of equation N1 (3 x K x N), and the prior slope (2 x N)."""

    light: F4
    sigma: F4
    weight: F4
    dark: NDArray[np.bool_]
    vectors: F4
    prior: F4

    def at(self, where: NDArray[np.intp]) -> Pixels:
        return Pixels(*(part[..., where] for part in self))


class Choice(NamedTuple):
    """For N pixels: the LEDs that count (K x N), what that costs, and the normals (3 x N)."""

    used: NDArray[np.bool_]
    cost: F4
    misfit: F4
    normal: F4
    twin: F4

    def take(self, tried: Choice, where: NDArray[np.intp]) -> None:
        """Replace what costs more than what was tried on some pixels."""
        better = tried.cost < self.cost[where]
        for part, other in zip(self, tried, strict=True):
            part[..., where[better]] = other[..., better]


class Rules(NamedTuple):
    """The node's parameters."""

    pair: str
    dark: int
    floor: np.float32
    price: np.float32
    one_sided: np.float32
    steepest: np.float32
    uneven: np.float32


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
    """Return the slope and the LEDs that explain each pixel's light best.

    The light of an LED k that reaches the pixel, relative to the film at rest, is n.v_k with
    |n| = 1 (`_near_light`, N1).  LEDs darker than ``floor`` standard deviations are excluded.
    Among the remaining LEDs, every subset that leaves out none, one or two (``dark``) is
    tried.  The subset of least cost wins::

        sum over used ((m_k - n.v_k) / sigma_k)^2 + price (LEDs left out)
        + sum over left out max((m_k - n.v_k) / spread_k + one_sided, 0)^2 + (m_k / 0.1)^2

    Each LED left out costs ``price``, and its light must be dark.  Shadows are not perfectly
    black: spread_k adds 1.5 % of the film's light to sigma_k, in quadrature.  Three or more
    LEDs give n by linear least squares, scaled to |n| = 1, and a Gauss-Newton step in the
    tangent plane.  Two LEDs give the two unit normals that fit exactly.

    Touch brightens the film unevenly, but by the same factor for all LEDs.  So three or more
    LEDs share an unknown factor with standard deviation ``uneven``, and the normal follows
    from the ratios of their light.  The cost of more than three LEDs allows for this factor,
    too.  The cost of three does not: there only |n| = 1 can reveal a shadow.

    Parameters
    ----------
    light, sigma
        K x H x W, relative to the film at rest, and its standard deviation.
    lights
        K x 3 in mm from the middle of the image.
    height
        H x W in mm, as far as known; the direction of the light depends on it.
    prior
        2 x H x W, the slope expected; for ``pair: prior`` only.
    pixel
        mm per px.
    uneven
        Standard deviation of the film's brightness, as a share.
    pair
        How to choose between a pair's two normals, unless one is the film at rest:
        ``prior`` takes the one nearer to the prior; ``attached`` the one that turns away from
        the dark LEDs (attached shadow), or the less steep one if both do alike.
    dark
        Largest number of LEDs left out, apart from those below the floor; with 0 all LEDs
        count as lit, even those.
    floor
        Light, in standard deviations, below which an LED certainly does not reach the pixel.
    price
        Cost of leaving out an LED, in squared standard deviations.
    one_sided
        Standard deviations by which a shadow has to be darker than the predicted light.
    steepest
        Largest slope returned, as 1 / n_z.

    Returns
    -------
    Labelled
        ``slope``, 2 x H x W, zero where fewer than two LEDs reach; ``twin``, the other slope
        that a pair of LEDs allows (else the slope again); ``variance`` of the slope from that
        of the light, 1e12 where not known; ``used``, bit k-1 set where the slope rests on LED
        k; ``shadow``, bit k-1 set where LED k does not light the pixel (not used, and less
        than half of what the slope predicts); ``misfit``, the sum of squares of the chosen
        subset.
    """
    rules = Rules(pair, dark, *map(np.float32, (floor, price, one_sided, steepest, uneven)))
    x, y = (places(size, np.float32(pixel)) for size in height.shape[::-1])

    def label_rows(rows: slice) -> Labelled:
        vectors = vectors_at(lights, x, y[rows, None], height[rows]).swapaxes(0, 1)
        images = light[:, rows], sigma[:, rows], vectors, prior[:, rows]
        pixels = _pixels(*(image.reshape(*image.shape[:-2], -1) for image in images), rules)
        made = _outputs(pixels, _cheapest(pixels, rules), rules)
        return Labelled(*(plane.reshape(*plane.shape[:-1], -1, x.size) for plane in made))

    blocks = in_blocks(label_rows, *height.shape)
    return Labelled(*(np.concatenate(parts, axis=-2) for parts in zip(*blocks, strict=True)))


label_lights.opencl(grid="H W", lanes="grid")


@label_lights.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """LEDs around the film, and moderate noise."""
    azimuth = (np.arange(K) + rng.uniform(-0.2, 0.2, K)) * 2 * np.pi / K
    reach, z = rng.uniform(20, 40, K), rng.uniform(30, 60, K)
    lights = np.column_stack([reach * np.cos(azimuth), reach * np.sin(azimuth), z])
    sigma = rng.uniform(0.005, 0.02, (K, H, W))
    return {"lights": lights.astype(np.float32), "sigma": sigma.astype(np.float32)}


def _pixels(light: F4, sigma: F4, vectors: F4, prior: F4, rules: Rules) -> Pixels:
    sigma = np.maximum(sigma, np.float32(1e-5))
    dark = (light < rules.floor * sigma) & (rules.dark > 0)
    return Pixels(light, sigma, ONE / (sigma * sigma), dark, vectors, prior)


def _cheapest(pixels: Pixels, rules: Rules) -> Choice:
    """For each set of LEDs: solve, find the cost; take the least.

    Leaving out LEDs costs at least their price and their light.  So a set is tried only where
    nothing cheaper is known: most pixels are explained by all LEDs.
    """
    count, size = pixels.light.shape
    level = np.repeat(np.array([[0], [0], [1]], np.float32), size, axis=1)
    none, infinite = np.zeros(size, np.float32), np.full(size, np.inf, np.float32)
    best = Choice(np.zeros((count, size), bool), infinite, none, level, level.copy())
    glow = np.where(pixels.dark, ZERO, np.square(pixels.light / SHADE))
    dark = _bits(pixels.dark)
    most = np.bitwise_count(dark) + rules.dark
    for number in range(count - 1):
        price = rules.price * np.float32(number)
        open_ = np.flatnonzero((best.cost > price) & (number <= most))
        for left_out in (s for s in range(1 << count) if s.bit_count() == number):
            lit = np.array([not left_out >> k & 1 for k in range(count)])
            least = price + glow[~lit][:, open_].sum(axis=0)
            where = open_[(dark[open_] | left_out == left_out) & (best.cost[open_] > least)]
            if where.size:
                best.take(_explain(pixels.at(where), lit, rules), where)
    return best


def _explain(pixels: Pixels, lit: NDArray[np.bool_], rules: Rules) -> Choice:
    """Solve for the normal by some LEDs, and find what leaving out the others costs."""
    number = np.count_nonzero(lit)
    weight = pixels.weight * lit[:, None]
    if number > 2:
        start = _linear(pixels, weight)
        judged = normal = twin = _turned(pixels, weight, start, rules.uneven)
        if number == 3:
            judged = _turned(pixels, weight, start, ZERO)
    else:
        normal, twin = _pair(pixels, lit, rules.pair)
        judged = normal
    uneven = rules.uneven if number > 3 else ZERO
    misfit = _products(pixels, weight, judged, uneven)[3, 3]
    light, sigma = pixels.light[~lit], pixels.sigma[~lit]
    over = light - np.maximum(_dot(pixels.vectors[:, ~lit], judged), ZERO)
    bright = np.maximum(over / np.sqrt(sigma * sigma + STRAY * STRAY) + rules.one_sided, ZERO)
    shadows = np.where(pixels.dark[~lit], ZERO, bright * bright + np.square(light / SHADE))
    cost = misfit + rules.price * np.float32(len(light)) + shadows.sum(axis=0)
    used = np.repeat(lit[:, None], cost.size, axis=1)
    return Choice(used, cost, misfit, normal, twin)


def _linear(pixels: Pixels, weight: F4) -> F4:
    """The direction of n with least squares of m - n.v, by Cramer's rule."""
    v, share = pixels.vectors, weight / weight.sum(axis=0)
    a = np.einsum("ikn,kn,jkn->ijn", v, share, v)
    b = np.einsum("ikn,kn,kn->in", v, share, pixels.light)
    n = _cross(a[1], a[2]) * b[0] + _cross(a[2], a[0]) * b[1] + _cross(a[0], a[1]) * b[2]
    return _visible(_unit(n))


def _products(pixels: Pixels, weight: F4, n: F4, uneven: F4 | np.float32) -> F4:
    """Return the 4 x 4 products a'Wb of what an LED's light tells near a normal n.

    The columns a, b are the derivatives J of n.v_k by the two tangents (n_z, 0, -n_x) and
    (0, n_z, -n_y), the light n.v_k, and the residual m_k - n.v_k.  W is the inverse of the
    light's covariance: sigma_k^2, and the film's brightness, which all LEDs share.
    """
    x, y, z = n
    vx, vy, vz = v = pixels.vectors
    shown = _dot(v, n)
    columns = np.stack([vx * z - vz * x, vy * z - vz * y, shown, pixels.light - shown])
    sums = np.einsum("akn,kn,bkn->abn", columns, weight, columns)
    along = sums[2]
    return sums - brightness_share(along[2], ONE, uneven) * along[:, None] * along


def _turned(pixels: Pixels, weight: F4, n: F4, uneven: np.float32) -> F4:
    """One Gauss-Newton step in the tangent plane, to a normal that noise does not bias.

    With noise of covariance C = (J'WJ)^-1, the metric G of the tangents, and f = C u for the
    products u of J with the light, a step from the linear solution goes too far by
    C (G f) + f tr(C G) / 2 on average, which off the axis of the LEDs turns the film at rest
    into a bowl.  Also, p and q come out too large by C (p, q).
    """
    x, y, z = n
    products = _products(pixels, weight, n, uneven)
    along, rest = products[:2, 2], products[:2, 3]
    c = _inverse(products[:2, :2], np.float32(1e-6))
    g = np.array([[z * z + x * x, x * y], [x * y, z * z + y * y]])
    spread = np.einsum("abn,abn->n", c, g)
    mild = MILD * z * z / np.maximum(spread, MILD * z * z)
    bias = HALF * spread * along + _times(g, _times(c, along)) + n[:2] / z
    turn = _times(c, rest - mild * bias)
    s, t = turn * (LONGEST / np.maximum(np.sqrt(np.square(turn).sum(axis=0)), LONGEST))
    return _unit(_visible(np.array([x + s * z, y + t * z, z - s * x - t * y])))


def _pair(pixels: Pixels, lit: NDArray[np.bool_], pair: str) -> tuple[F4, F4]:
    """The two unit normals that two LEDs allow, the likelier first."""
    first, second = _two_normals(pixels.vectors[:, lit], pixels.light[lit])
    flatter = first[2] >= second[2]
    if pair == "prior":
        p, q = pixels.prior
        towards = np.array([-p, -q, np.ones_like(p)])
        take = _dot(first, towards) >= _dot(second, towards)
    else:
        behind = pixels.vectors[:, ~lit]
        a, b = (_lit_behind(behind, n) for n in (first, second))
        take = np.where(np.abs(a - b) < ALIKE, flatter, a < b)
    take = np.where(np.maximum(first[2], second[2]) > AT_REST, flatter, take)
    return _visible(np.where(take, first, second)), _visible(np.where(take, second, first))


def _two_normals(v: F4, light: F4) -> tuple[F4, F4]:
    """Unit n with n.v = m for two LEDs; the nearest, twice, where noise leaves none."""
    a, b = v[:, 0], v[:, 1]
    aa, ab, bb = _dot(a, a), _dot(a, b), _dot(b, b)
    determinant = np.maximum(aa * bb - ab * ab, np.float32(1e-9))
    s, t = bb * light[0] - ab * light[1], aa * light[1] - ab * light[0]
    base = (a * s + b * t) / determinant
    beyond = np.sqrt(np.maximum(ONE - _dot(base, base), ZERO) / determinant)
    across = _cross(a, b) * beyond
    return _unit(base + across), _unit(base - across)


def _lit_behind(vectors: F4, n: F4) -> F4:
    """The light that the dark LEDs would give; plenty for a normal that the camera cannot see."""
    lit = np.maximum(_dot(vectors, n), ZERO).sum(axis=0)
    return np.asarray(lit + np.where(n[2] < np.float32(0.05), np.float32(10), ZERO))


def _outputs(pixels: Pixels, best: Choice, rules: Rules) -> Labelled:
    slope, twin = _slope(best.normal, rules), _slope(best.twin, rules)
    expected = np.maximum(_dot(pixels.vectors, best.normal), FAINTEST)
    dim = _bits((pixels.light < HALF * expected) & ~best.used)
    used = _bits(best.used)
    shadow = np.where(used == 0, _bits(pixels.dark), dim)
    variance = _variance(pixels, best, slope, rules.uneven)
    return Labelled(slope, twin, variance, used, shadow, best.misfit)


def _slope(n: F4, rules: Rules) -> F4:
    return np.asarray(-n[:2] / np.maximum(n[2], ONE / rules.steepest))


def _variance(pixels: Pixels, best: Choice, slope: F4, uneven: np.float32) -> F4:
    """(J'WJ)^-1 of the tangent plane, carried to p and q.

    d(p, q) = -((1 + p^2, p q), (p q, 1 + q^2)) d(s, t).
    """
    weight = np.where(best.used, pixels.weight, ZERO)
    unevens = np.where(np.count_nonzero(best.used, axis=0) > 2, uneven, ZERO)
    h = _products(pixels, weight, best.normal, unevens)[:2, :2]
    known = h[0, 0] * h[1, 1] - h[0, 1] * h[0, 1] > SINGULAR * h[0, 0] * h[1, 1]
    p, q = slope
    carry = np.array([[ONE + p * p, p * q], [p * q, ONE + q * q]])
    c = _inverse(np.where(known, h, np.eye(2, dtype=np.float32)[..., None]), ZERO)
    return np.where(known, np.einsum("abn,bcn,acn->an", carry, c, carry), UNKNOWN)


def _inverse(h: F4, soft: np.float32) -> F4:
    """The inverse of symmetric 2 x 2 matrices, kept finite by a share of the trace."""
    (xx, xy), (_, yy) = h
    determinant = xx * yy - xy * xy + soft * (xx + yy) ** 2 + TINY
    return np.array([[yy, -xy], [-xy, xx]]) / determinant


def _times(a: F4, b: F4) -> F4:
    """A 2 x 2 matrix times a vector."""
    return np.asarray(a[:, 0] * b[0] + a[:, 1] * b[1])


def _dot(a: F4, b: F4) -> F4:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _cross(a: F4, b: F4) -> F4:
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def _unit(n: F4) -> F4:
    return n / (np.sqrt(_dot(n, n)) + TINY)


def _visible(n: F4) -> F4:
    """Normals that the camera can see."""
    return np.array([n[0], n[1], np.maximum(n[2], FLATTEST)])


def _bits(flags: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Flags of up to 8 LEDs as labels: bit k-1 for LED k."""
    return np.packbits(flags, axis=0, bitorder="little")[0]
