"""A reflectance that varies over the film, for one-shot colour sensors.

Their LEDs are a few millimetres beside the film.  So light depends on the slope by another
function at every place, and grows with height.  Divided by the film at rest::

    I_k / I_flat - 1 = max(sum_b c_kb(x, y) B_b(n), -1) + c_k8(x, y) z                    (M1)

B are the second-order harmonics of equation 4 without the constant, each less its value at
rest, so that a film at rest (n = z axis, z = 0) has 1 exactly; z is the height in mm; every c
is a polynomial of degree 4 in x and y.  ``kernels/slope/solve_reflectance_map.cl`` holds the same.
"""

from typing import Annotated

import numpy as np

from tactograph.sdk import F4, F8, Port, SlopeNormal, robust_deviation

ReflectanceMap = Annotated[F4, Port("K 9 15", "1", low=-0.3, high=0.3)]
"""Coefficients of equation M1: 9 shades, 15 monomials of the place."""

PLACE_DEGREE = 4
PLACE_TERMS = 15
SHADE_COUNT = 9
"""Eight harmonics and the height."""
CAUCHY_SIGMAS = 3.0
"""Scale of Cauchy's weight, in standard deviations of the residual."""
NO_LIGHT = np.float32(-1)
"""Light less 1 of film that faces away from a light."""
RIDGE_SHARE = 1e-6
"""Relative regularisation that keeps terms which the presses do not determine at zero."""


def terms(x: F8, y: F8, shape: tuple[int, int]) -> F8:
    """Return the 15 monomials 1, u, v, u^2, u v, v^2, ... of the place, by growing degree.

    u and v are x and y in px from the image's middle, divided by half its width.
    """
    height, width = shape
    u = (x - 0.5 * (width - 1)) / (0.5 * width)
    v = (y - 0.5 * (height - 1)) / (0.5 * width)
    return np.stack([u ** (d - i) * v**i for d in range(PLACE_DEGREE + 1) for i in range(d + 1)])


def shades(slope: F8, height: F8) -> F8:
    """Return B of equation M1 and the height: 9 x N."""
    at_rest, bent = (SlopeNormal(*at).harmonics for at in (np.zeros((2, 1)), np.asarray(slope)))
    return np.concatenate([(bent - at_rest)[1:], height[None]])


def robust_weights(error: F8, weight: F8) -> F8:
    """Return `weight` lowered where errors are large against their median (Cauchy)."""
    spread = robust_deviation(error, axis=-1, keepdims=True) + 1e-9
    return np.asarray(weight / (1 + (error / (CAUCHY_SIGMAS * spread)) ** 2))


def predicted(reflectance: F8, shade: F8, place: F8) -> F8:
    """Return light less 1, K x N, by equation M1: K x 9 x 15, 9 x N, 15 x N."""
    light = np.einsum("kbq,bn,qn->kn", reflectance, shade, place, optimize=True)
    return np.maximum(light, NO_LIGHT)


def maps_over_film(reflectance: F4, shape: tuple[int, ...]) -> F4:
    """Return the coefficients of equation M1 at every pixel: K x 9 x H x W."""
    rows, columns = shape
    scale = 0.5 * np.float32(columns)
    u = (np.arange(columns, dtype=np.float32) - 0.5 * np.float32(columns - 1)) / scale
    v = (np.arange(rows, dtype=np.float32) - 0.5 * np.float32(rows - 1)) / scale
    place = np.empty((PLACE_TERMS, rows, columns), np.float32)
    place[0] = 1
    last = 0
    for degree in range(1, PLACE_DEGREE + 1):
        first = last + degree
        place[first : first + degree] = place[last : last + degree] * u[None, :]
        place[first + degree] = place[first - 1] * v[:, None]
        last = first
    maps = np.zeros((*reflectance.shape[:2], rows, columns), np.float32)
    for term in range(PLACE_TERMS):
        maps += reflectance[:, :, term, None, None] * place[term]
    return maps


def shading(n: tuple[F4, F4, F4], c: F4) -> tuple[F4, tuple[F4, F4, F4]]:
    """Return the sum over the eight harmonics of equation M1, and its derivative by n.

    Film that faces away from a light has none: the sum is -1 there at least.
    """
    x, y, z = n
    value = (
        c[0] * x + c[1] * y + c[2] * (z - 1)
        + c[3] * (x * y) + c[4] * (x * z) + c[5] * (y * z)
        + c[6] * (x * x - y * y) + c[7] * (3 * (z * z - 1))
    )  # fmt: skip
    gradient = (
        c[0] + c[3] * y + c[4] * z + 2 * c[6] * x,
        c[1] + c[3] * x + c[5] * z - 2 * c[6] * y,
        c[2] + c[4] * x + c[5] * y + 6 * c[7] * z,
    )
    lit = value > NO_LIGHT
    return np.maximum(value, NO_LIGHT), (gradient[0] * lit, gradient[1] * lit, gradient[2] * lit)


def rough_film(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, F4]:
    """Return an example of a rough film under lights from all sides, for tests."""
    azimuth = 2 * np.pi * np.arange(K) / K
    reflectance = rng.uniform(-0.02, 0.02, (K, SHADE_COUNT, PLACE_TERMS)).astype(np.float32)
    reflectance[:, 0, 0] += 0.6 * np.cos(azimuth)
    reflectance[:, 1, 0] += 0.6 * np.sin(azimuth)
    reflectance[:, 2, 0] += 0.8
    slope = rng.uniform(-0.5, 0.5, (2, H, W)).astype(np.float32)
    height = rng.uniform(0, 0.5, (H, W)).astype(np.float32)
    return {"reflectance": reflectance, "slope": slope, "height": height}
