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
from tactograph.nodes.light._only_read import only_read
from tactograph.nodes.shadow._pieces import images_of, room_for


class Labelled(NamedTuple):
    """A slope for each pixel, and what it rests on."""

    slope: Slope
    twin: Slope
    variance: SlopeVariance
    used: Labels
    shadow: Labels
    misfit: Annotated[F4, Port("H W", "1")]


class Rules(NamedTuple):
    """The node's parameters, and the sets of LEDs that may be left out."""

    by_prior: bool
    dark: int
    floor: np.float32
    price: np.float32
    one_sided: np.float32
    steepest: np.float32
    uneven: np.float32
    sets: NDArray[np.int64]


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
    from tactograph.nodes.shadow._label_loops import label

    numbers = map(np.float32, (floor, price, one_sided, steepest, uneven))
    told: list[Any] = [pair == "prior", dark, *numbers, _sets(len(light))]
    rules = Rules(*told)
    images, believed = images_of(light, sigma, lights, height, pixel), only_read(prior)
    made = _room_for(height.shape, wanted)

    def label_rows(rows: slice) -> None:
        label(rows.start, rows.stop, images, believed, rules, room_for(len(light)), made)

    in_blocks(label_rows, *height.shape)
    unwanted: dict[str, Any] = {name: None for name in made._fields if name not in wanted}
    return made._replace(**unwanted)


label_lights.opencl(grid="H W", lanes="grid")


@label_lights.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """LEDs around the film, and moderate noise."""
    azimuth = (np.arange(K) + rng.uniform(-0.2, 0.2, K)) * 2 * np.pi / K
    reach, z = rng.uniform(20, 40, K), rng.uniform(30, 60, K)
    lights = np.column_stack([reach * np.cos(azimuth), reach * np.sin(azimuth), z])
    sigma = rng.uniform(0.005, 0.02, (K, H, W))
    return {"lights": lights.astype(np.float32), "sigma": sigma.astype(np.float32)}


def _room_for(shape: tuple[int, int], wanted: Wanted) -> Labelled:
    """Arrays for the outputs that are wanted; the others are empty."""
    sizes = dict(zip("HW", shape, strict=True))
    planes: list[Any] = []
    for name in Labelled._fields:
        whole = label_lights.output_shape(name, sizes)
        size = whole if name in wanted else (0,) * len(whole)
        planes.append(np.empty(size, label_lights.outputs[name].dtype))
    return Labelled(*planes)


def _sets(count: int) -> NDArray[np.int64]:
    """The sets of LEDs that may be left out, small ones first; two LEDs must remain."""
    sets = [s for s in range(1 << count) if s.bit_count() <= count - 2]
    return np.array(sorted(sets, key=lambda s: (s.bit_count(), s)), np.int64)
