"""The pixels of the tables by a film's model, where no object was pressed."""

from typing import Annotated

import numpy as np

from tactograph.sdk import F4, Film, Noise, Port, node
from tactograph.sdk.nodes import film_light
from tactograph.sdk.unstable import TablePixels, rest_noise

TABLE_SIDE = 121
"""Rows and columns of the hemisphere of normals."""
MAX_SINE = 0.95
"""n_x and n_y go up to here: a slope of 3."""
MIN_LIGHT = 0.02
"""Light up to which a lamp does not reach a slope."""


@node
def model_tables(film: Film, flat: Annotated[F4, Port("K h w", "1")], noise: Noise) -> TablePixels:
    """Return the light that a film's model gives slopes in all directions, with a camera's noise.

    Parameters
    ----------
    film : the model (`film_light`), in the middle of the image
    flat, noise : K x h x w, and as `estimate_noise` gives it: how noisy light is

    Returns
    -------
    Light K x 1 x N, slope 2 x 1 x N, a mask of ones and the LEDs that reach each pixel.
    """
    ny, nx = (
        MAX_SINE * np.linspace(-1, 1, TABLE_SIDE)[index]
        for index in np.indices((TABLE_SIDE, TABLE_SIDE))
    )
    inside = np.hypot(nx, ny) < MAX_SINE
    across = np.stack([nx[inside], ny[inside]])
    slope = (-across / np.sqrt(1 - np.square(across).sum(axis=0))).astype(np.float32)
    light = film_light(slope[:, None], np.zeros_like(slope[:1]), film, 0.0)[:, 0]
    level = np.median(flat.reshape(len(flat), -1), axis=1)[:, None]
    deviation = rest_noise(level, noise, floor=1e-3)
    lit = (light > MIN_LIGHT) << np.arange(len(light))[:, None]
    light = light + np.random.default_rng(0).normal(size=light.shape) * deviation
    return TablePixels.of(light, slope, lit.sum(axis=0))
