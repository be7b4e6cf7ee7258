"""Pieces of rows whose pixels loops process side by side."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4
from tactograph.nodes.light._near_light import places
from tactograph.nodes.light._only_read import only_read

PIECE = 640
"""Pixels of a row that are processed side by side; they fit into the cache."""


class Images(NamedTuple):
    """Light and its standard deviation K x H x W, lights K x 3, height H x W, and the x and y of
    columns and rows in mm."""

    light: F4
    sigma: F4
    lights: F4
    height: F4
    x: F4
    y: F4


class Pixels(NamedTuple):
    """N pixels: light, its standard deviation and weight K x N, vectors K x 3N, the prior slope 2N,
    and the LEDs that certainly do not reach (K x N, and as bits where that counts).
    """

    light: F4
    sigma: F4
    weight: F4
    vectors: F4
    prior: F4
    below: NDArray[np.bool_]
    forced: NDArray[np.uint8]


class Choice(NamedTuple):
    """The best so far per pixel: normals 3N, the LEDs used, and what the choice costs."""

    normal: F4
    twin: F4
    used: NDArray[np.uint8]
    cost: F4
    misfit: F4


class Room(NamedTuple):
    """What a thread works on: a piece of a row, and those of its pixels that a set is tried on."""

    pixels: Pixels
    best: Choice
    chosen: Pixels
    tried: Choice
    where: NDArray[np.int64]
    """The place in the piece of each chosen pixel."""
    doubtful: NDArray[np.int64]
    sums: F4
    judged: F4
    """3N, the normals by which a set is judged."""


def images_of(light: F4, sigma: F4, lights: F4, height: F4, pixel: float) -> Images:
    """Gather what the loops read of a capture."""
    x, y = (places(size, np.float32(pixel)) for size in height.shape[::-1])
    return Images(*map(only_read, (light, sigma, lights, height, x, y)))


def room_for(leds: int) -> Room:
    """Working arrays for pieces of rows under `leds` LEDs."""

    def pixels() -> Pixels:
        planes, below = np.zeros((3, leds, PIECE), np.float32), np.zeros((leds, PIECE), np.bool_)
        vectors, prior = np.zeros((leds, 3 * PIECE), np.float32), np.zeros(2 * PIECE, np.float32)
        forced = np.zeros(PIECE, np.uint8)
        return Pixels(planes[0], planes[1], planes[2], vectors, prior, below, forced)

    def choice() -> Choice:
        normals, costs = np.zeros((2, 3 * PIECE), np.float32), np.zeros((2, PIECE), np.float32)
        return Choice(normals[0], normals[1], np.zeros(PIECE, np.uint8), costs[0], costs[1])

    where, doubtful = np.zeros((2, PIECE), np.int64)
    sums, judged = np.zeros(9 * PIECE, np.float32), np.zeros(3 * PIECE, np.float32)
    return Room(pixels(), choice(), pixels(), choice(), where, doubtful, sums, judged)
