"""Find which LEDs light each pixel, and from their light its slope."""

from __future__ import annotations

from itertools import combinations
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
    Wrap,
)
from tactograph.nodes.optics.cache_blocks import in_blocks
from tactograph.nodes.optics.near_light import (
    expected_light,
    light_vectors,
    places,
    unwrapped,
    vectors_at,
    wrapped,
)
from tactograph.nodes.optics.normals import (
    dot,
    linear_normal,
    normals_of_pair,
    slope_variance,
    tangent_products,
    turned_normal,
    visible,
)

AT_REST = 0.999
"""A pair's normal with a larger n_z is the film at rest: two lights are not 1 by accident."""
MIN_TWIN_DIFFERENCE = 0.02
"""Smallest difference of the dark LEDs' light that decides between a pair's two normals."""
MIN_EXPECTED_LIGHT = 0.08
"""Lower bound on the expected light, of which a shadow has less than half."""
STRAY_LIGHT = 0.015
"""Light in a shadow that is no noise: from the film, and ambient light not fully subtracted."""
MAX_SHADE_LIGHT = 0.1
"""Light that is bright for a shadow.  Without this, two dark LEDs could explain any pixel as lit
at a grazing angle, and the bright LEDs as shadows of still brighter light."""
MIN_EVEN_SHARE = np.float32(0.05)
"""Light of the darkest LED over that of the brightest, above which none may be in shadow."""
TIE_COST = np.float32(1e-3)
"""Costs that differ by less are equal: the set that was tried first is kept."""
ANY_BRIGHTNESS = 1e3
"""Standard deviation of a brightness of which nothing is known."""
LEVEL_NORMAL = np.array([[0], [0], [1]], np.float32)
Leds = NDArray[np.bool_]
"""Which of K LEDs are meant, for all pixels or for each (K x N)."""


class Labelled(NamedTuple):
    """A slope for each pixel, and what it rests on."""

    slope: Slope
    twin: Slope
    variance: SlopeVariance
    used: Labels
    shadow: Labels
    misfit: Annotated[F4, Port("H W", "1")]


class Pixels(NamedTuple):
    """N pixels: light, that above a shadow's, and one over its variance (K x N), the LEDs below
    the floor, the vectors of equation N1 (3 x K x N), and the prior slope (2 x N)."""

    light: F4
    shown: F4
    weight: F4
    below: Leds
    vectors: F4
    prior: F4

    def at(self, where: NDArray[np.intp]) -> Pixels:
        parts: Any = (part.take(where, axis=-1) for part in self)
        return Pixels(*parts)


class Choice(NamedTuple):
    """For N pixels: the LEDs used, what that costs, and the normals (3 x N)."""

    used: Labels
    cost: F4
    misfit: F4
    normal: F4
    twin: F4

    def improve(self, tried: Choice, where: NDArray[np.intp]) -> None:
        """Take what was tried on some pixels, where it costs less."""
        better = np.flatnonzero(tried.cost < self.cost[where] - TIE_COST)
        parts: Any = zip(self, tried, strict=True)
        for part, other in parts:
            part[..., where[better]] = other.take(better, axis=-1)


@node(
    tolerance=Flips(
        5e-3, 5e-3, 5e-3, why="sets of LEDs that explain a pixel equally well, nearly singular sets"
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
    wrap: Wrap | None = None,
    *,
    pair: Literal["prior", "attached"] = "attached",
    dark: Annotated[int, Interval(ge=0, le=2)] = 2,
    floor: Annotated[float, Ge(0)] = 3.0,
    price: Annotated[float, Ge(0)] = 12.0,
    one_sided: float = 2.0,
    steepest: Annotated[float, Gt(0)] = 30.0,
    dimmed: Annotated[float, Gt(0)] = 26.0,
    wanted: Wanted = EVERYTHING,
) -> Labelled:
    """Return the slope and the LEDs that explain each pixel's light best.

    The light of an LED k that reaches the pixel, relative to the film at rest, is n.v_k with
    |n| = 1 (`near_light`, N1).  LEDs darker than ``floor`` standard deviations are excluded.
    Among the remaining LEDs, every subset that leaves out none, one or two (``dark``) is
    tried.  The subset of least cost wins, with what light exceeds a shadow's as m and n.v in the
    second sum::

        sum over used ((m_k - n.v_k) / sigma_k)^2 + price (LEDs left out)
        + sum over left out max((m_k - max(n.v_k, 0)) / spread_k + one_sided, 0)^2
                            + (m_k / 0.1)^2                                               (S1)

    Each LED left out costs ``price``, and its light must be dark, which that of an LED below the
    floor is (the second sum passes over it).  Shadows are not perfectly
    black: spread_k adds 1.5 % of the film's light to sigma_k, in quadrature.  Three or more
    LEDs give n by linear least squares, scaled to |n| = 1, and a Gauss-Newton step in the
    tangent plane.  Two LEDs give the two unit normals that fit exactly.

    In a gel that scatters light, film behind the terminator still tells its slope (``wrap``,
    `near_light.wrapped`), though less surely.  There LEDs below the floor are not excluded, and
    count as what `matt_light` says they are known to.  `used` does not name them.

    Touch brightens the film unevenly, but by the same factor for all LEDs.  So three or more
    LEDs share an unknown factor with standard deviation ``uneven``, and the normal follows
    from the ratios of their light.  The cost of more than three LEDs allows for this factor,
    too.  The cost of three does not: there only |n| = 1 can reveal a shadow.

    Dirt on the lens or a hair dims all LEDs alike.  Where no subset costs less than ``dimmed``
    and no LED is dark (below the floor, or a twentieth of the brightest), all LEDs are tried at
    any lower brightness, at that price.  Their ratios give the slope; ``misfit`` is still that
    of the full brightness, so that `misfit_variance` trusts the slope little.

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
    wrap
        How far light goes on falling behind the terminator; None or 0: not at all.
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
    dimmed
        Cost of light that all LEDs lack alike, in squared standard deviations.

    Returns
    -------
    Labelled
        ``slope``, 2 x H x W, zero where fewer than two LEDs reach; ``twin``, the other slope
        that a pair of LEDs allows (else the slope again); ``variance`` of the slope from that
        of the light, 1e12 where not known; ``used``, bit k-1 set where the slope rests on LED
        k; ``shadow``, bit k-1 set where LED k does not light the pixel (not used, and less
        than half of what the slope predicts); ``misfit``, the sum of squares of the chosen
        subset.  NumPy makes all, ``wanted`` or not; a kernel leaves out what nobody reads.
    """
    x, y = (places(size, np.float32(pixel)) for size in height.shape[::-1])
    soft = wrap or 0.0

    def label_rows(rows: slice) -> Labelled:
        vectors = vectors_at(lights, x, y[rows, None], height[rows]).swapaxes(0, 1)
        images = light[:, rows], np.maximum(sigma[:, rows], 1e-5), vectors, prior[:, rows]
        m, spread, v, expected = (image.reshape(*image.shape[:-2], -1) for image in images)
        shown = wrapped(m, soft) + soft
        below = (shown < floor * spread) & (dark > 0)
        pixels = Pixels(m, shown, np.reciprocal(spread * spread), below, v, expected)
        best = _cheapest(pixels, pair, dark, price, one_sided, uneven, soft)
        _allow_dimmed(pixels, best, dimmed, uneven)
        slope, twin = (-n[:2] / np.maximum(n[2], 1 / steepest) for n in (best.normal, best.twin))
        variance, shadow = _variance(pixels, best, slope, uneven), _shadow(pixels, best, soft)
        used = best.used & ~_labels(below)
        made: Any = slope, twin, variance, used, shadow, best.misfit
        return Labelled(*(plane.reshape(*plane.shape[:-1], -1, x.size) for plane in made))

    blocks = in_blocks(label_rows, y.size, light[:, 0].size)
    return Labelled(*(np.concatenate(parts, axis=-2) for parts in zip(*blocks, strict=True)))


label_lights.opencl(grid="H W", lanes="grid")


@label_lights.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """LEDs around the film, and moderate noise; every other film is tilted in a soft light."""
    azimuth = (np.arange(K) + rng.uniform(-0.2, 0.2, K)) * 2 * np.pi / K
    reach, z = rng.uniform(20, 40, K), rng.uniform(30, 60, K)
    lights = np.column_stack([reach * np.cos(azimuth), reach * np.sin(azimuth), z])
    sigma = rng.uniform(0.005, 0.02, (K, H, W)).astype(np.float32)
    made: dict[str, Any] = {"wrap": float(rng.choice([0, rng.uniform(0.1, 0.3)]))}
    if made["wrap"]:
        sigma = rng.uniform(0.015, 0.03, (K, H, W)).astype(np.float32)
        slope = rng.uniform(-1.2, 1.2, (2, H, W)).astype(np.float32)
        vectors = light_vectors(lights.astype(np.float32), np.zeros((H, W), np.float32), 0.05)
        shown = wrapped(expected_light(vectors, slope), made["wrap"])
        shown = np.where(rng.random(shown.shape) < 0.05, -made["wrap"], shown)
        seen = np.asarray(shown + rng.normal(0, sigma), np.float32)
        made["light"], sigma = unwrapped(seen, sigma, made["wrap"])
    return made | {"lights": lights.astype(np.float32), "sigma": sigma}


def _cheapest(
    pixels: Pixels,
    pair: str,
    dark: int,
    price: float,
    one_sided: float,
    uneven: float,
    wrap: float,
) -> Choice:
    """For each set of LEDs: solve, find the cost; take the least.

    Leaving out LEDs costs at least their price and their light.  So a set is tried only where
    nothing cheaper is known: most pixels are explained by all LEDs.
    """
    leds, size = pixels.light.shape
    level, none = np.repeat(LEVEL_NORMAL, size, axis=1), np.zeros(size, np.float32)
    best = Choice(np.zeros(size, np.uint8), none + np.inf, none, level, level.copy())
    glow = np.where(pixels.below, 0, np.square(pixels.shown / MAX_SHADE_LIGHT))
    below = _labels(pixels.below)
    most, forced = np.bitwise_count(below) + np.uint8(dark), below * (wrap == 0)
    for number in range(leds - 1):
        for left_out in sorted(combinations(range(leds), number), key=lambda out: out[::-1]):
            lit = np.array([k not in left_out for k in range(leds)])
            least = price * number + ~lit @ glow
            allowed = (forced & _labels(lit) == 0) & (number <= most)
            where = np.flatnonzero(allowed & (best.cost > least))
            if where.size:
                tried = _explain(pixels.at(where), lit, pair, price, one_sided, uneven, wrap)
                best.improve(tried, where)
    return best


def _explain(
    pixels: Pixels,
    lit: Leds,
    pair: str,
    price: float,
    one_sided: float,
    uneven: float,
    wrap: float,
) -> Choice:
    """Solve for the normal by the LEDs that are lit, and find what leaving out the others costs."""
    number, v, light = np.count_nonzero(lit), pixels.vectors, pixels.light
    weight = pixels.weight * lit[:, None]
    if number == 2:
        normal, twin = _pair(pixels, lit, pair)
        judged = normal
    else:
        start = linear_normal(v, light, weight)
        judged = normal = twin = turned_normal(v, light, weight, start, uneven)
        # Among three LEDs only |n| = 1 can reveal a shadow, so their brightness counts.
        if number == 3:
            judged = turned_normal(v, light, weight, start, 0)
    misfit = tangent_products(v, light, weight, judged, uneven if number > 3 else 0)[3, 3]
    dark, spread = pixels.shown[~lit], np.sqrt(1 / pixels.weight[~lit] + STRAY_LIGHT**2)
    over = (dark - wrapped(dot(v[:, ~lit], judged), wrap) - wrap) / spread
    bright = np.square(np.maximum(over + one_sided, 0)) + np.square(dark / MAX_SHADE_LIGHT)
    cost = misfit + price * len(dark) + np.where(pixels.below[~lit], 0, bright).sum(axis=0)
    return Choice(np.full(cost.shape, _labels(lit)), cost, misfit, normal, twin)


def _allow_dimmed(pixels: Pixels, best: Choice, price: float, uneven: float) -> None:
    """Let all LEDs count at any lower brightness, where no set explains their light at less cost.

    That of three LEDs is explained exactly.
    """
    even = pixels.light.min(axis=0) > MIN_EVEN_SHARE * pixels.light.max(axis=0)
    where = np.flatnonzero((best.cost > price) & even & ~pixels.below.any(axis=0))
    if where.size == 0:
        return
    here = pixels.at(where)
    v, light, weight = here.vectors, here.light, here.weight
    normal = turned_normal(v, light, weight, linear_normal(v, light, weight), ANY_BRIGHTNESS)
    missing = -tangent_products(v, light, weight, normal, 0)[2, 3]
    left = tangent_products(v, light, weight, normal, ANY_BRIGHTNESS)[3, 3]
    cost = np.where(missing > 0, left + np.float32(price), np.float32(np.inf))
    known = uneven if len(light) > 3 else 0
    misfit = tangent_products(v, light, weight, normal, known)[3, 3]
    every = np.full(cost.shape, _labels(np.ones(len(light), bool)))
    best.improve(Choice(every, cost, misfit, normal, normal), where)


def _pair(pixels: Pixels, lit: Leds, pair: str) -> tuple[F4, F4]:
    """The two normals that two LEDs allow, the likelier first."""
    first, second = normals_of_pair(pixels.vectors[:, lit], pixels.light[lit])
    flatter = first[2] >= second[2]
    if pair == "prior":
        p, q = pixels.prior
        likelier = dot(first, (-p, -q, 1)) >= dot(second, (-p, -q, 1))
    else:
        one, other = (_lit_behind(pixels.vectors[:, ~lit], n) for n in (first, second))
        likelier = np.where(np.abs(one - other) < MIN_TWIN_DIFFERENCE, flatter, one < other)
    take = np.where(np.maximum(first[2], second[2]) > AT_REST, flatter, likelier)
    return visible(np.where(take, first, second)), visible(np.where(take, second, first))


def _lit_behind(vectors: F4, n: F4) -> F4:
    """The light that the dark LEDs would give; plenty for a normal that the camera cannot see."""
    return np.maximum(dot(vectors, n), 0).sum(axis=0) + np.float32(10) * (n[2] < 0.05)


def _shadow(pixels: Pixels, best: Choice, wrap: float) -> Labels:
    """The LEDs whose light is missing; where the slope is not known, those below the floor."""
    expected = np.maximum(
        wrapped(dot(pixels.vectors, best.normal), wrap) + wrap, MIN_EXPECTED_LIGHT
    )
    below = _labels(pixels.below)
    missing = _labels(pixels.shown < expected / 2) & (~best.used | below)
    return np.where(best.used == 0, below, missing)


def _variance(pixels: Pixels, best: Choice, slope: F4, uneven: float) -> F4:
    """The variance of the slope that follows from that of the light."""
    used = best.used >> np.arange(len(pixels.light), dtype=np.uint8)[:, None] & 1
    unevens = np.where(np.bitwise_count(best.used) > 2, np.float32(uneven), 0)
    weight = pixels.weight * used
    return slope_variance(pixels.vectors, pixels.light, weight, best.normal, slope, unevens)


def _labels(leds: Leds) -> Labels:
    """The labels, bit k-1 for LED k."""
    return (leds.T << np.arange(len(leds), dtype=np.uint8)).sum(axis=-1, dtype=np.uint8).T
