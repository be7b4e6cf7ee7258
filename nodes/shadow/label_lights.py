"""Find which LEDs light each pixel, and the slope that their light gives.

Long because sets of three LEDs or more, pairs and dimmed light each need a solution and a cost.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial, reduce
from itertools import product
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

import numpy as np
from annotated_types import Ge, Gt, Interval
from numpy.typing import NDArray

from tactograph.graph import EVERYTHING, Close, Port, SizeLimit, Wanted, node
from tactograph.nodes import (
    F4,
    Height,
    Labels,
    LabelTurn,
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
    lights_around,
    places,
    unwrapped,
    vectors_at,
    wrapped,
)
from tactograph.nodes.optics.normals import (
    dot,
    light_products,
    linear_normal,
    normals_of_pair,
    slope_variance,
    turned_normal,
    visible,
)

AT_REST = 0.999
"""A pair's normal with a larger n_z is the film at rest: two lights are not 1 by chance."""
MIN_TWIN_DIFFERENCE = 0.02
"""Smallest difference of the dark LEDs' light that decides between a pair's two normals."""
MIN_EXPECTED_LIGHT = 0.08
"""Lower bound on the expected light; a shadow has less than half of the expected light."""
STRAY_LIGHT = 0.015
"""Light in a shadow beyond noise: from the film, and ambient light not fully subtracted."""
MAX_SHADE_LIGHT = 0.1
"""Light that is bright for a shadow.  Without this cost, two dark LEDs could explain any pixel as
lit at a grazing angle, and the bright LEDs as shadows of still brighter light."""
MIN_EVEN_SHARE = np.float32(0.05)
"""Ratio of the darkest light to the brightest above which no LED is taken to be shadowed."""
TIE_COST = np.float32(1e-3)
"""Costs that differ by less are equal: the set that was tried first is kept."""
ANY_BRIGHTNESS = 1e3
"""Standard deviation of an unknown brightness."""
LEVEL_NORMAL = np.array([[0], [0], [1]], np.float32)
Leds = NDArray[np.bool_]
"""Mask of K LEDs, for all pixels together or for each (K x N)."""


class Labelled(NamedTuple):
    """A slope for each pixel, its labels and its variance."""

    slope: Slope
    twin: Slope
    variance: SlopeVariance
    used: Labels
    shadow: Labels
    misfit: Annotated[F4, Port("H W", "1")]


class Rules(NamedTuple):
    """Cost of a set of LEDs, and limits on the sets that are tried.

    Parameters
    ----------
    pair
        How to choose between a pair's two normals, unless one is the film at rest:
        ``prior`` takes the one nearer to the prior; ``attached`` the one that turns away from
        the dark LEDs (attached shadow), or the less steep one if both do alike.
    dark
        Largest number of LEDs left out, apart from those below the floor; with 0 all LEDs
        count as lit, including those below it.
    floor : light, in standard deviations, below which an LED certainly does not reach the pixel
    price : cost of leaving out an LED, in squared standard deviations
    one_sided : standard deviations by which a shadow has to be darker than the predicted light
    steepest : largest slope returned, as 1 / n_z
    dimmed : cost of dimming all LEDs by the same factor, in squared standard deviations
    """

    pair: Literal["prior", "attached"] = "attached"
    dark: Annotated[int, Interval(ge=0, le=2)] = 2
    floor: Annotated[float, Ge(0)] = 3.0
    price: Annotated[float, Ge(0)] = 12.0
    one_sided: float = 2.0
    steepest: Annotated[float, Gt(0)] = 30.0
    dimmed: Annotated[float, Gt(0)] = 26.0


class Pixels(NamedTuple):
    """N pixels.  `vectors` (3 x K x N) are those of N1, `prior` (2 x N) is the expected slope.

    By LED (K x N): the light, one over its variance, how far it is above a shadow's light, whether
    it is below the floor, and the cost of that light if the LED is left out.
    """

    light: F4
    weight: F4
    vectors: F4
    prior: F4
    above_shadow: F4
    below: Leds
    shade_cost: F4


class Choice(NamedTuple):
    """LEDs used (K x N), their cost, and the normals (3 x N), for N pixels."""

    used: Leds
    cost: F4
    misfit: F4
    normal: F4
    twin: F4

    def improve(
        self,
        pixels: Pixels,
        allowed: Leds,
        least: F4 | float,
        explain: Callable[[Pixels], Choice],
    ) -> None:
        """Take another explanation where it is `allowed` and cheaper; it costs at least `least`."""
        where = np.flatnonzero(allowed & (self.cost > least))
        if where.size:
            # The first explanation mostly applies to all pixels, which need no gathering.
            candidate = explain(pixels if where.size == allowed.size else _at(pixels, where))
            better = np.flatnonzero(candidate.cost < self.cost.take(where) - TIE_COST)
            self.put(where.take(better), _at(candidate, better))

    def put(self, where: NDArray[np.intp], other: Choice) -> None:
        """Replace the explanation of some pixels."""
        planes: Any = zip(self, other, strict=True)
        for plane, values in planes:
            plane[..., where] = values


Planes = TypeVar("Planes", Pixels, Choice)


@node(
    tolerance=Close(
        5e-3,
        5e-3,
        share=5e-3,
        why="sets of LEDs that explain a pixel equally well, nearly singular sets",
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
    turn: LabelTurn | None = None,
    *,
    rules: Rules,
    wanted: Wanted = EVERYTHING,
) -> Labelled:
    """Return the slope and the LEDs that explain each pixel's light best.

    The light of an LED k that reaches the pixel, relative to the film at rest, is n.v_k with
    |n| = 1 (`near_light`, N1).  LEDs darker than ``floor`` standard deviations are excluded.
    Among the remaining LEDs, every subset that leaves out none, one or two (``dark``) is
    tried, and the subset of least cost wins.  In the second sum m and n.v are measured from the
    light of a shadow::

        sum over used ((m_k - n.v_k) / sigma_k)^2 + price (LEDs left out)
        + sum over left out max((m_k - max(n.v_k, 0)) / spread_k + one_sided, 0)^2
                            + (m_k / 0.1)^2                                               (S1)

    Each LED left out costs ``price``, and its light must be dark.  The second sum skips LEDs below
    the floor, which are dark.  Shadows are not perfectly black: spread_k adds 1.5 % of the film's
    light to sigma_k, in quadrature.  Three or more LEDs give n by linear least squares, scaled to
    |n| = 1, and a Gauss-Newton step in the tangent plane.  Two LEDs give the two unit normals that
    fit exactly.

    In a gel that scatters light, the light behind the terminator still depends on the slope
    (``wrap``, `near_light.wrapped`), though weakly.  There LEDs below the floor are not excluded;
    they count with the standard deviation that `matt_light` gives them.  `used` does not name them.

    Touch brightens the film unevenly, but by the same factor for all LEDs.  So three or more
    LEDs share an unknown factor with standard deviation ``uneven``, and the normal follows
    from the ratios of their light.  The cost of more than three LEDs allows for this factor,
    too.  The cost of three does not: there only |n| = 1 can reveal a shadow.

    On a film that diffuses light, leaving LEDs out may do more harm than good (`judge_labels`).
    There a subset wins only if it turns the normal by more than ``turn`` from the normal of all
    LEDs.  This leaves pixels whose light no smooth film explains, as at a crack.

    Dirt on the lens or a hair dims all LEDs by the same factor.  Where every subset costs more than
    ``dimmed`` and no LED is dark (below the floor, or a twentieth of the brightest), all LEDs are
    tried at any lower brightness, at that price.  The ratios of their light give the slope;
    ``misfit`` is still that of the full brightness, so `misfit_variance` trusts the slope little.

    Parameters
    ----------
    light, sigma : K x H x W, relative to the film at rest, and its standard deviation
    lights : K x 3 in mm from the middle of the image
    height : H x W in mm, as far as known; the direction of the light depends on it
    prior : 2 x H x W, the expected slope; for ``pair: prior`` only
    pixel : mm per px
    uneven : standard deviation of the film's brightness, as a share
    wrap : how far light keeps falling beyond the terminator; None or 0: not at all
    turn : radians by which leaving LEDs out must turn a normal; None or 0: any angle

    Returns
    -------
    ``slope``, 2 x H x W, zero where fewer than two LEDs reach; ``twin``, the other slope that a
    pair of LEDs allows (else the slope again); ``variance`` of the slope from that of the light,
    1e12 where unknown; ``used``, bit k-1 set where the slope rests on LED k; ``shadow``, bit k-1
    set where LED k does not light the pixel (not used, and less than half of what the slope
    predicts); ``misfit``, the sum of squares of the chosen subset.  The NumPy function returns all
    of them; the kernel skips outputs that are not ``wanted``.
    """
    x, y = (places(size, np.float32(pixel)) for size in height.shape[::-1])
    wrapping = wrap or 0.0

    def label_rows(rows: slice) -> Labelled:
        vectors = vectors_at(lights, x, y[rows, None], height[rows]).swapaxes(0, 1)
        images = light[:, rows], sigma[:, rows], vectors, prior[:, rows]
        m, spread, v, expected = (image.reshape(*image.shape[:-2], -1) for image in images)
        spread = np.maximum(spread, 1e-5)
        above_shadow, weight = wrapped(m, wrapping) + wrapping, np.reciprocal(spread * spread)
        below = (above_shadow < rules.floor * spread) & (rules.dark > 0)
        shade_cost = np.where(below, 0, np.square(above_shadow / MAX_SHADE_LIGHT))
        pixels = Pixels(m, weight, v, expected, above_shadow, below, shade_cost)
        best = _best_set(pixels, rules, uneven, wrapping, turn or 0.0)
        normals = best.normal, best.twin
        slope, twin = (-n[:2] / np.maximum(n[2], 1 / rules.steepest) for n in normals)
        unevens = np.where(best.used.sum(axis=0) > 2, np.float32(uneven), 0)
        variance = slope_variance(v, m, weight * best.used, best.normal, slope, unevens)
        # An LED is shadowed if its light is missing; without a slope, if it is below the floor.
        due = np.maximum(wrapped(dot(v, best.normal), wrapping) + wrapping, MIN_EXPECTED_LIGHT)
        missing = (above_shadow < due / 2) & (~best.used | below)
        shadow = _labels(np.where(best.used.any(axis=0), missing, below))
        planes: Any = slope, twin, variance, _labels(best.used & ~below), shadow, best.misfit
        return Labelled(*(plane.reshape(*plane.shape[:-1], -1, x.size) for plane in planes))

    blocks = in_blocks(label_rows, y.size, light[:, 0].size)
    return Labelled(*(np.concatenate(parts, axis=-2) for parts in zip(*blocks, strict=True)))


label_lights.opencl(grid="H W", lanes="grid")


@label_lights.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """LEDs around the film, and moderate noise; every second film is a gel that scatters light."""
    lights = lights_around(rng, K)
    sigma = rng.uniform(0.005, 0.02, (K, H, W)).astype(np.float32)
    wrap, turn = float(rng.choice([0, rng.uniform(0.1, 0.3)])), float(rng.choice([0, 0.8]))
    params: dict[str, Any] = {"wrap": wrap, "turn": turn}
    if wrap:
        sigma = rng.uniform(0.015, 0.03, (K, H, W)).astype(np.float32)
        slope = rng.uniform(-1.2, 1.2, (2, H, W)).astype(np.float32)
        vectors = light_vectors(lights, np.zeros((H, W), np.float32), 0.05)
        shown = wrapped(expected_light(vectors, slope), wrap)
        shown = np.where(rng.random(shown.shape) < 0.05, -wrap, shown)
        image = np.asarray(shown + rng.normal(0, sigma), np.float32)
        params["light"], sigma = unwrapped(image, sigma, wrap)
    return params | {"lights": lights, "sigma": sigma}


def _best_set(pixels: Pixels, rules: Rules, uneven: float, wrap: float, turn: float) -> Choice:
    """Solve for each set of LEDs, and choose the one of least cost for each pixel.

    Leaving out LEDs costs at least their price and their light.  So a set is tried only where
    no cheaper one is known: all LEDs explain most pixels.
    """
    light, below = pixels.light, pixels.below
    leds, size = light.shape
    level, none = np.repeat(LEVEL_NORMAL, size, axis=1), np.zeros(size, np.float32)
    best = Choice(np.zeros(below.shape, bool), none + np.inf, none, level, level.copy())
    excluded, max_left_out = _labels(below & (wrap == 0)), below.sum(axis=0) + rules.dark
    explain = partial(_explain, rules=rules, uneven=uneven, wrap=wrap)
    (_, all_leds), *subsets = _sets(leds)
    best.improve(pixels, excluded == 0, 0.0, partial(explain, lit=all_leds))
    # A pixel is settled if all LEDs explain it for less than the price of leaving one out.
    unsettled = np.flatnonzero(best.cost > rules.price)
    doubtful, choice = _at(pixels, unsettled), _at(best, unsettled)
    excluded_there, max_left_out = excluded.take(unsettled), max_left_out.take(unsettled)
    for left_out, lit in subsets:
        allowed = (excluded_there & _labels(lit) == 0) & (left_out <= max_left_out)
        least = rules.price * left_out + ~lit @ doubtful.shade_cost
        choice.improve(doubtful, allowed, least, partial(explain, lit=lit))
    best.put(unsettled, choice)
    if turn > 0:
        by_all = explain(pixels, lit=all_leds)
        alike = dot(by_all.normal, best.normal) > np.cos(turn)
        best.put(where := np.flatnonzero((excluded == 0) & alike), _at(by_all, where))
    even = ~below.any(axis=0) & (light.min(axis=0) > MIN_EVEN_SHARE * light.max(axis=0))
    best.improve(pixels, even, rules.dimmed, partial(_dimmed, price=rules.dimmed, uneven=uneven))
    return best


def _at(parts: Planes, where: NDArray[np.intp]) -> Planes:
    """The planes of some pixels."""
    planes: Any = parts
    return type(parts)(*(plane.take(where, axis=-1) for plane in planes))


def _sets(leds: int) -> list[tuple[int, Leds]]:
    """The sets of two LEDs or more, largest first, with the number of LEDs that each leaves out."""
    sets = sorted(product((True, False), repeat=leds), key=sum, reverse=True)
    return [(leds - sum(lit), np.array(lit[::-1])) for lit in sets if sum(lit) > 1]


def _explain(pixels: Pixels, lit: Leds, rules: Rules, uneven: float, wrap: float) -> Choice:
    """Solve for the normal by the LEDs that are lit; find the cost of leaving out all others."""
    out, number, v, light = ~lit, np.count_nonzero(lit), pixels.vectors, pixels.light
    weight = pixels.weight * lit[:, None]
    if number == 2:
        normal, twin = _pair(pixels, lit, rules.pair)
        judged = normal
    else:
        start = linear_normal(v, light, weight)
        judged = normal = twin = turned_normal(v, light, weight, start, uneven)
        # Among three LEDs only |n| = 1 can reveal a shadow, so their brightness counts.
        if number == 3:
            judged = turned_normal(v, light, weight, start, 0)
    misfit = light_products(v, light, weight, judged, uneven if number > 3 else 0)[1, 1]
    spread = np.sqrt(1 / pixels.weight[out] + STRAY_LIGHT**2)
    over = (pixels.above_shadow[out] - wrapped(dot(v[:, out], judged), wrap) - wrap) / spread
    bright = np.where(pixels.below[out], 0, np.square(np.maximum(over + rules.one_sided, 0)))
    cost = misfit + rules.price * len(bright) + (bright + pixels.shade_cost[out]).sum(axis=0)
    return Choice(np.broadcast_to(lit[:, None], light.shape), cost, misfit, normal, twin)


def _dimmed(pixels: Pixels, price: float, uneven: float) -> Choice:
    """Solve by all LEDs at any lower brightness, which explains three LEDs exactly."""
    v, light, weight = pixels.vectors, pixels.light, pixels.weight
    normal = turned_normal(v, light, weight, linear_normal(v, light, weight), ANY_BRIGHTNESS)
    bright = light_products(v, light, weight, normal, uneven if len(light) > 3 else 0)
    residual = light_products(v, light, weight, normal, ANY_BRIGHTNESS)[1, 1]
    cost = np.where(bright[0, 1] < 0, residual + np.float32(price), np.float32(np.inf))
    return Choice(np.ones(light.shape, bool), cost, bright[1, 1], normal, normal)


def _pair(pixels: Pixels, lit: Leds, pair: str) -> tuple[F4, F4]:
    """The two normals that two LEDs allow, the likelier first."""
    first, second = normals_of_pair(pixels.vectors[:, lit], pixels.light[lit])
    flatter = first[2] >= second[2]
    if pair == "prior":
        p, q = pixels.prior
        likelier = dot(first, (-p, -q, 1)) >= dot(second, (-p, -q, 1))
    else:
        # The light that the dark LEDs would give, raised for a normal that the camera cannot see.
        one, other = (
            np.maximum(dot(pixels.vectors[:, ~lit], n), 0).sum(axis=0) + 10 * (n[2] < 0.05)
            for n in (first, second)
        )
        likelier = np.where(np.abs(one - other) < MIN_TWIN_DIFFERENCE, flatter, one < other)
    take = np.where(np.maximum(first[2], second[2]) > AT_REST, flatter, likelier)
    return visible(np.where(take, first, second)), visible(np.where(take, second, first))


def _labels(leds: Leds) -> Labels:
    """Pack a mask of LEDs into labels, bit k-1 for LED k."""
    # Eight times as fast as `packbits` along the first axis.
    bits: Any = (led << k for k, led in enumerate(leds.view(np.uint8)))
    return reduce(np.bitwise_or, bits)
