"""The pixels of the tables by a film's model, where no object was pressed."""

from typing import Annotated, NamedTuple

import numpy as np

from tactograph.sdk import F4, Film, Labels, Light, Mask, Noise, Port, Slope, node
from tactograph.sdk.nodes import film_light

TABLE_SIDE = 121
"""Rows and columns of the hemisphere of normals."""
MAX_SINE = 0.95
"""n_x and n_y go up to here: a slope of 3."""
MIN_LIGHT = 0.02
"""Light up to which a lamp does not reach a slope."""
MIN_LEVEL = 1e-3
"""Least light of the film at rest that noise is compared with."""


class TablePixels(NamedTuple):
    """Pixels of the tables without a pressed object, as an image of one row."""

    light: Light
    slope: Slope
    mask: Mask
    lit: Labels


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
    level = np.maximum(np.median(flat.reshape(len(flat), -1), axis=1)[:, None], MIN_LEVEL)
    deviation = np.sqrt(noise[0] * level + noise[1]) / level
    lit = ((light > MIN_LIGHT) << np.arange(len(light))[:, None]).sum(axis=0)
    noisy = light + np.random.default_rng(0).normal(size=light.shape) * deviation
    light, bits = noisy.astype(np.float32), lit.astype(np.uint8)
    return TablePixels(light[:, None], slope[:, None], np.ones_like(bits[None]), bits[None])
