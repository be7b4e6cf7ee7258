"""A ball pressed into the film: how deep its middle lies, and where the camera's rays meet it."""

from typing import Any

import numpy as np

from tactograph.nodes import F8

MAX_SQUARED_RADIUS = 1 + 1e-6
"""Tolerance, relative to the squared radius, for a ray that meets a ball."""


def sunk(radius: Any, rim: Any) -> F8:
    """Return the depth of balls' centres below the film at rest, from their contact radii."""
    return np.asarray(np.sqrt(np.maximum(radius**2 - rim**2, 0)))


def ball_height(u: F8, v: F8, centre: tuple[Any, Any, Any], radius: Any, camera: float) -> F8:
    """Return the height in mm at which the ray through u, v on the film at rest meets a ball.

    If the ray misses the ball, it is the height where the ray comes closest.
    """
    cx, cy, cz = centre
    du, dv = u - cx, v - cy
    a = 1 + camera**2 * (u**2 + v**2)
    b = camera * (u * du + v * dv) + cz
    c = du * du + dv * dv + cz * cz - radius**2
    return np.asarray((b + np.sqrt(np.maximum(b * b - a * c, 0))) / a)


def away_on(
    u: F8,
    v: F8,
    beneath: F8 | float,
    base: float,
    centre: tuple[float, float, float],
    radius: float,
    camera: float,
) -> F8:
    """Return how far in mm samples count as from a ball's middle, on film of any shape.

    As far as on a plane the ball rises as high above the film; film that rays beside the ball see
    lies at least its radius away.

    Parameters
    ----------
    u, v : of length N in mm, as seen
    beneath, base : the heights in mm of the film at rest: of the N samples, under the ball's middle
    centre, radius : of the ball in mm
    camera : one over the height of the pupil
    """
    cx, cy, cz = centre
    z = ball_height(u, v, centre, radius, camera)
    aside = np.hypot(u * (1 - camera * z) - cx, v * (1 - camera * z) - cy)
    above = base - cz + z - beneath
    away = np.sqrt(np.maximum(radius**2 - np.maximum(above, 0) ** 2, 0))
    hit = aside**2 + (z - cz) ** 2 < radius**2 * MAX_SQUARED_RADIUS
    return np.where(hit, away, np.maximum(aside, radius))
