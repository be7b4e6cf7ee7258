"""The true normals of balls, and those found from their light by a film's model."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F8
from tactograph.nodes.calibrate.ball.balls_on_film import BALL_RINGS, BALL_SECTORS, Balls, Fitted
from tactograph.nodes.calibrate.film.film_fit import MAX_ROUNDS
from tactograph.nodes.optics.film import rest_below, turned


class BallNormals(NamedTuple):
    """True and found normals, 3 x N; the light without bounces, K x N; places, and their lift."""

    truth: F8
    fitted: F8
    direct: F8
    place: tuple[F8, F8, F8]
    lift: F8


def ball_normals(balls: Balls, fitted: Fitted, uneven: float = 0.0) -> BallNormals:
    """Find the normal of every sample from its light; `uneven` as in `Film`."""
    film = fitted.film
    truth, place, lift = balls.touched_place(fitted.shifts, film)
    direct = balls.direct(fitted.shifts, film)
    n, rest = truth, rest_below(film, *place)
    for _ in range(MAX_ROUNDS):
        n = turned(film, direct, n, place, uneven, rest, lift)
    return BallNormals(truth, n, direct, place, lift)


class NormalError(NamedTuple):
    """The normals' root mean square error in degrees, and what noise alone leaves of it."""

    degrees: float
    noise: float


def normal_error(balls: Balls, fitted: Fitted) -> NormalError:
    """Return the error of the normals found from light.

    Noise is averaged over parts of each ball, because heights, as sums of slopes, average it, too.
    """
    truth, solved, *_ = ball_normals(balls, fitted)
    part = _parts(balls, truth)
    number = np.maximum(np.bincount(part), 1)
    is_sampled, away = np.bincount(part) > 0, solved - truth
    mean = np.stack([np.bincount(part, e) / number for e in away])
    # Parts may hold a single sample, so all tell the noise of one.
    spread = np.square(away - mean[:, part]).sum() / max(part.size - is_sampled.sum(), 1)
    noise = spread * (1 / number)[is_sampled].mean()
    whole, least = np.degrees(np.sqrt([(mean * mean).sum(0)[is_sampled].mean(), noise]))
    return NormalError(float(whole), float(least))


def _parts(balls: Balls, normal: F8) -> NDArray[np.intp]:
    """The number of the ball's part in which each sample lies."""
    ring = np.minimum((BALL_RINGS * (1 - normal[2] ** 2)).astype(int), BALL_RINGS - 1)
    turn = np.arctan2(normal[1], normal[0]) / (2 * np.pi) % 1
    sector = (turn * BALL_SECTORS).astype(int) % BALL_SECTORS
    return np.asarray((balls.ball * BALL_RINGS + ring) * BALL_SECTORS + sector, np.intp)
