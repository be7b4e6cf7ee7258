"""Refine a coarse slope by a first-order Taylor step of the reflectance model."""

from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from tactograph.graph import Close, node
from tactograph.nodes import F4, Labels, Light, Reflectance, Slope
from tactograph.nodes.optics.cache_blocks import in_blocks
from tactograph.nodes.optics.gauss_newton import SlopeNormal


@node(
    neutral="slope",
    tolerance=Close(
        2e-3,
        2e-3,
        share=1e-3,
        why="the 2 x 2 system is nearly singular where light hardly depends on slope, and "
        "amplifies the rounding of its entries",
    ),
)
def refine_taylor(
    light: Light,
    slope: Slope,
    shadow: Labels,
    reflectance: Reflectance,
    *,
    steps: Annotated[int, Interval(ge=0, le=10)] = 1,
    max_turn_rad: Annotated[float, Gt(0)] = 0.15,
) -> Slope:
    """Return G = G_0 + J^+ (I - R(G_0)) where no LED is shadowed (equations 5 and 6).

    R is the reflectance in second-order spherical harmonics (equation 4), J its derivative with
    respect to (p, q), and J^+ the pseudo-inverse of J.  A shadowed pixel keeps its coarse slope
    (section 3.5 b).

    Parameters
    ----------
    light : K x H x W, 1 on the film at rest
    slope : 2 x H x W, the coarse G_0
    shadow : H x W; a pixel with any bit set keeps its slope
    reflectance : K x 9, the coefficients of R from `fit_reflectance`
    steps : number of Taylor steps; the paper takes one
    max_turn_rad
        Longest step, as the angle in radians by which it turns the normal.  The expansion holds
        only near G_0; on steep sides, where light hardly depends on slope, an unlimited step would
        amplify noise.

    Returns
    -------
    G, 2 x H x W.
    """
    lights, coarse = light.reshape(len(light), -1), slope.reshape(2, -1)
    lit, refined = shadow.ravel() == 0, np.empty((2, shadow.size), np.float32)

    def refine(part: slice) -> None:
        refined[:, part] = coarse[:, part]
        p, q = refined[:, part]
        for _ in range(steps):
            dp, dq = _step(lights[:, part], p, q, reflectance, np.float32(max_turn_rad))
            np.add(p, dp, out=p, where=lit[part])
            np.add(q, dq, out=q, where=lit[part])

    in_blocks(refine, shadow.size)
    return refined.reshape(slope.shape)


def _step(light: Light, p: F4, q: F4, reflectance: F4, limit: np.float32) -> tuple[F4, F4]:
    """Solve the normal equations J^T J (dp, dq) = J^T (I - R), and shorten the step to `limit`."""
    at = SlopeNormal(p, q)
    a = b = c = u = v = np.float32(0) * p
    for plane, coefficients in zip(light, reflectance, strict=True):
        value, gradient = _reflectance(at.normal, coefficients)
        j_p, j_q = at.by_slope(gradient)
        residual = plane - value
        a, b, c = a + j_p * j_p, b + j_p * j_q, c + j_q * j_q
        u, v = u + j_p * residual, v + j_q * residual
    return at.step((a, b, c), (u, v), limit)


def _reflectance(n: tuple[F4, F4, F4], c: F4) -> tuple[F4, tuple[F4, F4, F4]]:
    """R(n) of equation 4 and its gradient; `c` is in the order of `SlopeNormal.harmonics`."""
    x, y, z = n
    value = (
        c[0] + c[1] * x + c[2] * y + c[3] * z
        + c[4] * (x * y) + c[5] * (x * z) + c[6] * (y * z)
        + c[7] * (x * x - y * y) + c[8] * (3 * z * z - 1)
    )  # fmt: skip
    gradient = (
        c[1] + c[4] * y + c[5] * z + 2 * c[7] * x,
        c[2] + c[4] * x + c[6] * z - 2 * c[7] * y,
        c[3] + c[5] * x + c[6] * y + 6 * c[8] * z,
    )
    return value, gradient


refine_taylor.opencl(grid="H W", lanes="grid")
