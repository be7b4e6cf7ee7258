"""Normals from the light of near LEDs: by least squares, or from two LEDs.

Arrays are planes of N pixels: vectors v of equation N1 (`near_light`) 3 x K x N, light m and
weight (one over its variance; 0 for an LED that does not count) K x N, and normals 3 x N.  The
tangents of a normal n are (n_z, 0, -n_x) and (0, n_z, -n_y).

The kernel of `label_lights` sums w v v' = A and w m v once, and computes the products of the
tangents T at any normal from these: J'WJ = T'AT.
"""

from typing import Any

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes.optics.near_light import brightness_share

MIN_NORMAL_Z = 0.02
"""Smallest n_z of a normal; the camera does not see steeper film."""
MAX_TURN_RAD = 0.3
"""Longest Gauss-Newton step, in radians."""
FULL_BIAS_VARIANCE = 0.01
"""Variance of a normal, over n_z^2, up to which its bias by noise is fully corrected."""
MIN_SINE_SQUARED = 1e-4
"""Squared sine of the angle between two lights' gradients below which they count as one."""
UNKNOWN_VARIANCE = 1e12
MIN_DIVISOR = 1e-20


def normals_of(slope: Any) -> F4:
    """The unit normals of slopes, 2 x ..., towards the camera: 3 x ..."""
    p, q = slope
    nz = 1 / np.sqrt(1 + p * p + q * q)
    return np.stack([-p * nz, -q * nz, nz])


def linear_normal(v: F4, light: F4, weight: F4) -> F4:
    """The direction of the n that minimises the squares of m - n.v, by Cramer's rule."""
    share = weight / weight.sum(axis=0)
    a = np.einsum("ikn,kn,jkn->ijn", v, share, v)
    b = np.einsum("ikn,kn,kn->in", v, share, light)
    return visible(_unit(times(cofactors(a), b)))


def tangent_products(v: F4, light: F4, weight: F4, n: F4, uneven: F4 | float) -> F4:
    """Return the 2 x 4 products a'Wb of the gradients with themselves, prediction and residual.

    a are the derivatives J of n.v_k along the two tangents at a normal n; b are J, the prediction
    n.v_k, and the residual m_k - n.v_k.  W is the inverse of the light's covariance: the variance
    of each LED, plus that of the film's brightness, which all LEDs share (``uneven`` is its
    standard deviation).
    """
    x, y, z = n
    projection = dot(v, n)
    columns = np.stack([v[0] * z - v[2] * x, v[1] * z - v[2] * y, projection, light - projection])
    sums = np.einsum("akn,kn,bkn->abn", columns[:3], weight, columns)
    return sums[:2] - brightness_share(sums[2, 2], 1, uneven) * sums[2, :2, None] * sums[2]


def light_products(v: F4, light: F4, weight: F4, n: F4, uneven: F4 | float) -> F4:
    """Return the 2 x 2 products a'Wb of the light n.v_k and the residual: `tangent_products`."""
    projection = dot(v, n)
    columns = np.stack([projection, light - projection])
    sums = np.einsum("akn,kn,bkn->abn", columns, weight, columns)
    return sums - brightness_share(sums[0, 0], 1, uneven) * sums[0, :, None] * sums[0]


def turned_normal(v: F4, light: F4, weight: F4, n: F4, uneven: float) -> F4:
    """Take one Gauss-Newton step in the tangent plane, without bias by noise (S3).

    With the covariance C = (J'WJ)^-1, the metric G of the tangents, and f = C u for the products
    u of J with the light, a step from the linear solution goes too far by C (G f) + f tr(C G) / 2
    on average.  Off the axis of the LEDs that would turn the film at rest into a bowl.  In
    addition, p and q come out too large by C (p, q).
    """
    x, y, z = n
    products = tangent_products(v, light, weight, n, uneven)
    projection, residual = products[:, 2], products[:, 3]
    c = _inverse(products[:, :2], 1e-6)
    g = np.array([[z * z + x * x, x * y], [x * y, z * z + y * y]])
    spread = np.einsum("abn,abn->n", c, g)
    bias = times(g, times(c, projection)) + spread * projection / 2 + n[:2] / z
    mild = FULL_BIAS_VARIANCE * z * z / np.maximum(spread, FULL_BIAS_VARIANCE * z * z)
    turn = times(c, residual - mild * bias)
    s, t = turn * (MAX_TURN_RAD / np.maximum(np.hypot(*turn), MAX_TURN_RAD))
    return _unit(visible(np.array([x + s * z, y + t * z, z - s * x - t * y])))


def normals_of_pair(v: F4, light: F4) -> tuple[F4, F4]:
    """The two unit normals n with n.v = m for two LEDs (S2), or twice the nearest normal."""
    (a, b), (of_a, of_b) = v.swapaxes(0, 1), light
    aa, ab, bb = dot(a, a), dot(a, b), dot(b, b)
    determinant = np.maximum(aa * bb - ab * ab, 1e-9)
    s, t = (bb * of_a - ab * of_b) / determinant, (aa * of_b - ab * of_a) / determinant
    base = a * s + b * t
    across = cross(a, b) * np.sqrt(np.maximum(1 - dot(base, base), 0) / determinant)
    return _unit(base + across), _unit(base - across)


def slope_variance(v: F4, light: F4, weight: F4, n: F4, slope: F4, uneven: F4) -> F4:
    """The variance of p and q (S4): (J'WJ)^-1 of the tangent plane, transformed to p and q."""
    h = tangent_products(v, light, weight, n, uneven)[:, :2]
    is_determined = h[0, 0] * h[1, 1] - h[0, 1] * h[0, 1] > MIN_SINE_SQUARED * h[0, 0] * h[1, 1]
    p, q = slope
    carry = np.array([[1 + p * p, p * q], [p * q, 1 + q * q]])
    c = _inverse(np.where(is_determined, h, np.eye(2, dtype=np.float32)[..., None]), 0)
    return np.where(
        is_determined, np.einsum("abn,bcn,acn->an", carry, c, carry), np.float32(UNKNOWN_VARIANCE)
    )


def visible(n: F4) -> F4:
    """Limit normals to those that the camera can see."""
    return np.array([n[0], n[1], np.maximum(n[2], MIN_NORMAL_Z)])


def angle_between(a: Any, b: Any) -> Any:
    """Angles in radians between the normals of slopes, 2 x ..., accurate also for small angles.

    A cosine would lose all digits there, and so would products of slopes that nearly cancel, so the
    cross product is taken with the difference.  A root and an arc sine are faster than `arctan2`.
    """
    p, q = a - b
    twist = p * b[1] - q * b[0]
    lengths = np.sqrt((1 + a[0] * a[0] + a[1] * a[1]) * (1 + b[0] * b[0] + b[1] * b[1]))
    length_sum = lengths + (1 + a[0] * b[0] + a[1] * b[1])
    square = (p * p + q * q + twist * twist) / (2 * lengths * length_sum)
    return 2 * np.arcsin(np.sqrt(np.minimum(square, 1)))


def dot(a: Any, b: Any) -> F4:
    """Scalar products of vectors, whose components are along the first axis."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Any, b: Any) -> F4:
    """Cross products of vectors, whose components are along the first axis."""
    return np.array([a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1))])


def _unit(n: F4) -> F4:
    return n * np.reciprocal(np.sqrt(dot(n, n)) + MIN_DIVISOR)


def _inverse(h: F4, soft: float) -> F4:
    """The inverse of symmetric 2 x 2 matrices, kept finite by a share of the trace."""
    (xx, xy), (_, yy) = h
    determinant = xx * yy - xy * xy + soft * np.square(xx + yy) + MIN_DIVISOR
    return np.array([[yy, -xy], [-xy, xx]]) / determinant


def cofactors(a: Any) -> Any:
    """Adjugates of symmetric 3 x 3 matrices: their inverse times their determinant."""
    return np.array([cross(a[1], a[2]), cross(a[2], a[0]), cross(a[0], a[1])])


def times(a: Any, b: Any) -> Any:
    """Matrices times vectors."""
    return np.einsum("ijn,jn->in", a, b)
