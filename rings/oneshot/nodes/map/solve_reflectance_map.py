"""Slope from light whose dependence on slope varies over the film."""

from typing import Annotated, Any

import numpy as np
from annotated_types import Gt, Interval

from tactograph.rings.oneshot.nodes.map.mapped_light import mapped_light
from tactograph.rings.oneshot.nodes.map.reflectance_map import (
    PLACE_DEGREE,
    SHADE_COUNT,
    ReflectanceMap,
    maps_over_film,
    rough_film,
    shading,
)
from tactograph.sdk import F4, Close, Height, Launch, Light, SizeLimit, Slope, SlopeNormal, node

STILL_RAD = 1e-3
"""Longest step after which a pixel stops, or half of `max_turn_rad` if that is less."""


@node(
    sizes={"K": SizeLimit(2, 8, "two unknowns need two lights, and labels have 8 bits")},
    tolerance=Close(
        2e-3,
        2e-3,
        share=2e-3,
        why="Gauss-Newton on lights that hardly depend on slope amplifies rounding",
    ),
)
def solve_reflectance_map(
    light: Light,
    flat: Light,
    height: Height,
    reflectance: ReflectanceMap,
    *,
    steps: Annotated[int, Interval(ge=1, le=30)] = 8,
    prior: Annotated[float, Gt(0)] = 4e-4,
    max_turn_rad: Annotated[float, Gt(0)] = 0.3,
) -> Slope:
    """Return the slope that explains the light best, by Gauss-Newton from the film at rest.

    Minimises sum_k flat_k (I_k - 1 - max(sum_b c_kb B_b(n), -1) - c_k8 z)^2 + prior (p^2 + q^2)
    per pixel (equations M1 and M2).  The flat image is the weight because under shot noise the
    variance of light relative to it is inversely proportional to it: dim light carries little
    information.

    Parameters
    ----------
    light, flat : K x H x W: the light relative to the film at rest, and the film at rest
    height : H x W in mm, from the pass before; zero in the first
    reflectance : K x 9 x 15, as `fit_reflectance_map` gives it
    steps : Gauss-Newton steps at most
    prior : weight that favours small slopes; matters where light does not determine the slope
    max_turn_rad : longest step, as the angle in radians by which it turns the normal
    """
    maps = maps_over_film(reflectance, light.shape[1:])
    rests = [plane - 1 - c[SHADE_COUNT - 1] * height for plane, c in zip(light, maps, strict=True)]
    start = np.zeros((2, *light.shape[1:]), np.float32)
    return solved(rests, flat, maps, start, steps, prior, max_turn_rad)


def solved(
    rests: list[F4],
    weight: F4,
    maps: F4,
    start: F4,
    steps: int = 8,
    prior: float = 4e-4,
    max_turn_rad: float = 0.3,
) -> F4:
    """Return the slopes of pixels, in rows or in a list, by Gauss-Newton from a start.

    Parameters
    ----------
    rests : K of the light less 1 and less what height adds
    weight, maps, start : K x ..., K x 9 x ..., 2 x ...
    """
    p, q = start
    moving = np.ones(p.shape, bool)
    least = np.float32(min(STILL_RAD, max_turn_rad / 2))
    for _ in range(steps):
        square, dp, dq = _step(
            rests, weight, maps, p, q, np.float32(prior), np.float32(max_turn_rad)
        )
        p, q = np.where(moving, p + dp, p), np.where(moving, q + dq, q)
        moving &= np.hypot(dp, dq) > least * square
        if not moving.any():
            break
    return np.asarray(np.stack([p, q]), np.float32)


def _step(
    rests: list[F4], flat: F4, maps: F4, p: F4, q: F4, prior: np.float32, max_turn_rad: np.float32
) -> tuple[F4, F4, F4]:
    """1 + p^2 + q^2, and one solution of the weighted normal equations, cut to `max_turn_rad`."""
    at = SlopeNormal(p, q)
    a = c = np.full_like(p, prior)
    b = np.zeros_like(p)
    s, t = -prior * p, -prior * q
    for rest, weight, coefficients in zip(rests, flat, maps, strict=True):
        value, gradient = shading(at.normal, coefficients)
        j_p, j_q = at.by_slope(gradient)
        residual = rest - value
        w_p, w_q = weight * j_p, weight * j_q
        a, b, c = a + w_p * j_p, b + w_p * j_q, c + w_q * j_q
        s, t = s + w_p * residual, t + w_q * residual
    return at.square, *at.step((a, b, c), (s, t), max_turn_rad)


@solve_reflectance_map.opencl()
def _launch(run: Launch) -> None:
    """First the map along every row, then the pixels."""
    count, rows, columns = (run.sizes[name] for name in "KHW")
    lines = run.scratch((rows, count * SHADE_COUNT, PLACE_DEGREE + 1))
    work = (rows * count * SHADE_COUNT,)
    run.kernel("polynomials_of_rows", work, run.inputs["reflectance"], lines, count, rows, columns)
    planes = (run.inputs[name] for name in ("light", "flat", "height"))
    out = run.outputs["solve_reflectance_map"]
    steps, prior, max_turn_rad = (run.settings[name] for name in ("steps", "prior", "max_turn_rad"))
    settings = steps, prior, max_turn_rad, min(STILL_RAD, max_turn_rad / 2)
    grid = run.in_row_lanes(rows, columns)
    run.kernel("solve", grid, *planes, lines, out, count, rows, columns, *settings)


@solve_reflectance_map.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """A rough film under lights from all sides."""
    film = rough_film(rng, K, H, W)
    light = mapped_light(**film)
    return {name: film[name] for name in ("reflectance", "height")} | {"light": light}
