"""Errors of the light, and what they do to the slopes and steps of a film, on the host."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tactograph.nodes import F4, Height, Labels, Light, LightPositions, Mask, Slope
from tactograph.nodes.height._height_system import Window
from tactograph.nodes.light._cache_blocks import in_blocks
from tactograph.nodes.light._near_light import places
from tactograph.nodes.light._only_read import only_read


class Unperturbed(NamedTuple):
    """What the errors start from, inside the window."""

    light: F4
    """K x h x w."""
    sigma: F4
    slope: F4
    """2 x h x w."""
    height: F4
    x: F4
    """w, in mm from the middle of the image."""
    y: F4
    bounced: F4
    """K x h x w; without rows where none is known."""
    changed: F4
    """By how much that changed in the last pass, likewise."""


class Response(NamedTuple):
    """The response of the slopes to small changes of the lights and to noise."""

    by_p: F4
    """K x h x w, the derivative of p by each LED's light."""
    by_q: F4
    by_place: F4
    """K x 3 x h x w, the derivative of an LED's light by its position, per mm."""
    alone: F4
    """h x w, the noise of p; with the next two a root of the covariance of p and q."""
    along: F4
    """The noise of q that is correlated with it."""
    across: F4
    """The noise of q that is independent of it."""


class Error(NamedTuple):
    """One error: the LEDs' displacement, its signs, its wave, and the keys of its draws."""

    moved: F4
    """K x 3 in mm."""
    bounce: np.float32
    """The share by which light thrown on the film is wrong."""
    settling: np.float32
    across: np.float32
    """The direction of the wave."""
    down: np.float32
    of_columns: F4
    """2 x w, the cosine and sine of the wave's phase that a column adds, times its amplitude."""
    of_rows: F4
    """2 x h, of a row."""
    steeper: np.float32
    light_key: np.uint32
    right_key: np.uint32
    down_key: np.uint32


class Turns(NamedTuple):
    """Errors of steps where slopes differ, in mm: h x w-1 to the right and h-1 x w down."""

    right: F4
    down: F4


def film_inside(
    window: Window,
    light: Light,
    sigma: Light,
    slope: Slope,
    height: Height,
    pixel: float,
    bounced: Light | None,
    earlier: Light | None,
) -> Unperturbed:
    """What the errors start from, inside the window."""
    rows, columns = height.shape
    x, y = places(columns, np.float32(pixel)), places(rows, np.float32(pixel))
    thrown = changed = np.zeros((0, 0, 0), np.float32)
    if bounced is not None:
        thrown = window.of(bounced)
        changed = thrown - window.of(earlier) if earlier is not None else changed
    planes = *map(window.of, (light, sigma, slope, height)), x[window.columns], y[window.rows]
    return Unperturbed(*map(only_read, (*planes, thrown, changed)))


def response_of(
    film: Unperturbed,
    lights: LightPositions,
    used: Labels,
    rest: Mask,
    uneven: float,
    flat_noise: np.float32,
    shared: np.float32,
) -> Response:
    """The response of the slopes to small changes of the lights and to noise."""
    from tactograph.nodes.height._error_loops import respond

    leds, *size = film.light.shape
    shapes = *((leds, *size) for _ in range(2)), (leds, 3, *size), *(size for _ in range(3))
    made = Response(*(np.empty(shape, np.float32) for shape in shapes))
    read = only_read(lights), only_read(used), only_read(rest)
    of_film = *read, np.float32(uneven), flat_noise, shared

    def respond_in(rows: slice) -> None:
        respond(rows.start, rows.stop, film, *of_film, made)

    in_blocks(respond_in, *film.height.shape)
    return made
