"""A sensor's light as a polynomial of normal and position: the model of GelSight's files.

The light of LED k at normal n and position (u, v) is m_k = max(0, n'A n + b.n + c), and all ten
coefficients are polynomials in u and v, of monomials 1, u, v, u^2, u v, v^2, ...  Off-diagonal
terms of A count twice; an eleventh coefficient scales the others.  u and v are counted from the
middle of the frame, in units of its shorter side.
"""

from itertools import combinations_with_replacement
from typing import Annotated, NamedTuple

import numpy as np

from tactograph.sdk import F4, Light, Port, SlopeNormal

MODEL_NUMBERS = 11
"""a00, a01, a02, a11, a12, a22, b0, b1, b2, c, and the scale of these."""
PIXEL_UNKNOWNS = 3
"""Unknowns of a pixel: p, q and the brightness.  Only more LEDs than these show a model's error."""
MIN_SCALE = np.float32(1e-3)
MIN_DIVISOR = 1e-9


class LightModel(NamedTuple):
    """The light of K LEDs by normal and position."""

    quadratic: Annotated[F4, Port("K 11 15", "1", low=-0.5, high=0.5)]
    """Coefficients by LED, term and monomial."""
    linear: Annotated[F4, Port("K 3 15", "1", low=-0.5, high=0.5)]
    """The same of L_k in m_k = L_k.n, from which the search for a normal starts."""
    u: Annotated[F4, Port("W", "1", low=-0.7, high=0.7)]
    v: Annotated[F4, Port("H", "1", low=-0.7, high=0.7)]
    """Positions of the columns and the rows."""
    degree: Annotated[float, Port(unit="1", high=4)]
    """Largest degree of the monomials; coefficients of higher ones are 0."""
    dark: Annotated[F4, Port("K", "1", high=0.2)]
    """Light in the shadow of an LED, which the gel diffuses; it only tells shadows."""
    gain: Light | None
    """Factor on the light, K x H x W: the sensor's own flat-field correction."""


def monomials(u: F4, v: F4, degree: int) -> F4:
    """1, u, v, u^2, u v, v^2, ..., v^degree: M x N of positions N."""
    of_u, of_v = [np.ones_like(u)], [np.ones_like(v)]
    for _ in range(degree):
        of_u.append(of_u[-1] * u)
        of_v.append(of_v[-1] * v)
    return np.stack([of_u[d - j] * of_v[j] for d in range(degree + 1) for j in range(d + 1)])


def coefficients(model: F4, powers: F4) -> F4:
    """The coefficients at positions: T x K x N of a model K x T x 15."""
    summed = np.zeros((model.shape[1], len(model), *powers.shape[1:]), np.float32)
    for column, power in zip(model.T, powers, strict=False):
        summed += column.reshape(*column.shape, *(1,) * power.ndim) * power
    return summed


def modelled_light(c: F4, n: F4) -> tuple[F4, F4]:
    """The light m at normals 3 x N, K x N, and its derivative by n, 3 x K x N.

    Both are 0 where the light would be below.
    """
    x, y, z = n
    turned = np.stack(
        [
            c[0] * x + c[1] * y + c[2] * z,
            c[1] * x + c[3] * y + c[4] * z,
            c[2] * x + c[4] * y + c[5] * z,
        ]
    )
    scale = np.maximum(c[10], MIN_SCALE)
    linear = turned + c[6:9]
    light = scale * (x * linear[0] + y * linear[1] + z * linear[2] + c[9])
    lit = np.where(light > 0, scale, np.float32(0))
    return np.maximum(light, np.float32(0)), lit * (turned + linear)


def slope_by_light(slope: F4, brightness: F4, model: LightModel, place: tuple[F4, F4]) -> F4:
    """The derivative of p and q by each LED's light, 2 x K x H x W, with the brightness free."""
    powers = monomials(*place, int(model.degree))
    at = SlopeNormal(*slope)
    m, gradient = modelled_light(coefficients(model.quadratic, powers), np.stack(at.normal))
    norm = np.maximum(np.sum(m * m, axis=0), MIN_DIVISOR)
    free = []
    for j in at.by_slope(gradient):
        free.append(brightness * (j - m * (np.sum(m * j, axis=0) / norm)))
    x_by, y_by = free
    xx, xy, yy = (np.sum(a * b, axis=0) for a, b in combinations_with_replacement(free, 2))
    determinant = np.maximum(xx * yy - xy * xy, MIN_DIVISOR)
    return np.stack([yy * x_by - xy * y_by, xx * y_by - xy * x_by]) / determinant
