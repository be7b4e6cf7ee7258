"""What a model leaves of the balls' light once the camera's noise is averaged out."""

import numpy as np

from tactograph.nodes import F8
from tactograph.nodes.calibrate.film.balls_on_film import Balls, Fitted, predicted

RING_COUNT, SECTOR_COUNT = 8, 12
"""Rings of equal area, and sectors, in which samples of all balls are averaged."""
MIN_SAMPLES_EACH = 5
"""Fewest samples of a part from which a spread is estimated."""
MEDIAN_OF_SQUARES = 0.455
"""Median of the square of a normal variable."""


def light_pattern(balls: Balls, fitted: Fitted) -> float:
    """Return the standard deviation of the light's mean departure by ring and sector, robustly.

    A pixel's noise hides a departure of some thousandths; the mean of many pixels shows it.
    """
    left = predicted(balls, fitted) - balls.light
    part = _parts(balls)
    count = np.bincount(part, minlength=RING_COUNT * SECTOR_COUNT)
    told = count >= MIN_SAMPLES_EACH

    def means(values: F8) -> F8:
        sums = [np.bincount(part, plane, count.size)[told] for plane in values]
        return np.asarray(np.stack(sums) / count[told])

    middle, square = means(left), means(left * left)
    noise = np.median((square - middle**2) / count[told])
    departure = np.median(middle**2) / MEDIAN_OF_SQUARES
    return float(np.sqrt(max(departure - noise, 0.0)))


def _parts(balls: Balls) -> F8:
    """The number of each sample's part of its ball."""
    x, y = balls.centre[balls.ball].T
    u, v = balls.u - x, balls.v - y
    reached = np.zeros(len(balls.centre))
    away = u * u + v * v
    np.maximum.at(reached, balls.ball, away)
    ring = (RING_COUNT * away / np.maximum(reached[balls.ball], 1e-12)).astype(int)
    sector = ((np.arctan2(v, u) / (2 * np.pi) % 1) * SECTOR_COUNT).astype(int)
    ring, sector = np.minimum(ring, RING_COUNT - 1), np.minimum(sector, SECTOR_COUNT - 1)
    return np.asarray(ring * SECTOR_COUNT + sector)
