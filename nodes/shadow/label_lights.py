"""Tell for each pixel which LEDs light it, and find its slope from those."""

from __future__ import annotations

from collections.abc import Iterator
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


class Made(NamedTuple):
    """The node's outputs; those that nobody wants are empty."""

    slope: F4
    twin: F4
    variance: F4
    used: NDArray[np.uint8]
    shadow: NDArray[np.uint8]
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
    from tactograph.nodes.shadow._label_loops import label

    numbers = map(np.float32, (floor, price, one_sided, steepest, uneven))
    told: list[Any] = [pair == "prior", dark, *numbers, _sets(len(light))]
    rules = Rules(*told)
    images, believed = images_of(light, sigma, lights, height, pixel), only_read(prior)
    made = _outputs(height.shape, wanted)

    def label_rows(rows: slice) -> None:
        label(rows.start, rows.stop, images, believed, rules, room_for(len(light)), made)

    in_blocks(label_rows, *height.shape)
    found: Iterator[Any] = (
        plane if name in wanted else None for name, plane in zip(made._fields, made, strict=True)
    )
    return Labelled(*found)


label_lights.opencl(grid="H W", lanes="grid")


@label_lights.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """LEDs around the film, and noise that is neither none nor all."""
    azimuth = (np.arange(K) + rng.uniform(-0.2, 0.2, K)) * 2 * np.pi / K
    reach, z = rng.uniform(20, 40, K), rng.uniform(30, 60, K)
    lights = np.column_stack([reach * np.cos(azimuth), reach * np.sin(azimuth), z])
    sigma = rng.uniform(0.005, 0.02, (K, H, W))
    return {"lights": lights.astype(np.float32), "sigma": sigma.astype(np.float32)}


def _outputs(shape: tuple[int, int], wanted: Wanted) -> Made:
    """Room for what is wanted."""
    sizes = dict(zip("HW", shape, strict=True))
    planes: list[Any] = []
    for name in Made._fields:
        whole = label_lights.output_shape(name, sizes)
        size = whole if name in wanted else (0,) * len(whole)
        planes.append(np.empty(size, label_lights.outputs[name].dtype))
    return Made(*planes)


def _sets(count: int) -> NDArray[np.int64]:
    """The sets of LEDs that may be left out, small ones first; two LEDs stay."""
    sets = [s for s in range(1 << count) if s.bit_count() <= count - 2]
    return np.array(sorted(sets, key=lambda s: (s.bit_count(), s)), np.int64)
