"""The normals of balls, and those that their light says by a film's model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tactograph.nodes.calibrate._film_fit import Balls, Fitted
from tactograph.nodes.light._film import turned
from tactograph.nodes.light._near_light import F8

STEPS = 4
"""Of a normal, from the ball's own."""


class BallNormals(NamedTuple):
    """The balls' normals and those found, 3 x N; the light without bounces, K x N; x, y, z."""

    truth: F8
    found: F8
    direct: F8
    place: tuple[F8, F8, F8]


def ball_normals(balls: Balls, fitted: Fitted) -> BallNormals:
    """Find the normal of every sample from its light, by a fitted film."""
    film = fitted.film
    truth, x, y, z = balls.seen(fitted.shifts, film.camera)
    direct, place = balls.light - film.albedo * balls.bounced, (x, y, np.maximum(z, film.contact))
    n = truth
    for _ in range(STEPS):
        n = turned(film, direct, n, place)
    return BallNormals(truth, n, direct, place)
