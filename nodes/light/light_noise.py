"""State the standard deviation of each light."""

from typing import Annotated

import numpy as np
from annotated_types import Gt

from tactograph.graph import Close, node
from tactograph.nodes import F4, Light, Noise

SATURATED_LIGHT = 0.998
"""Fraction of full scale that a camera of 8 bits rounds to full scale: 1 - 0.5 / 255."""


@node(tolerance=Close(1e-6, 1e-5, why="rounding of a square root and a division"))
def light_noise(
    image: Light,
    flat: Light,
    noise: Noise,
    *,
    floor: Annotated[float, Gt(0)] = 0.02,
) -> Light:
    """Return the standard deviation of the light relative to the film at rest.

    It is sqrt(shot I + read) / I_flat: the shot noise of photons, and the read noise of the
    camera's electronics.  A saturated pixel gives only a lower bound of its light, so its deviation
    is full scale.

    Parameters
    ----------
    image : K x H x W, as captured
    flat : K x H x W, the untouched film
    noise : (shot, read), from `estimate_noise`
    floor : lower bound on the divisor, as for `flat_field`
    """
    shot, read = noise
    sigma = np.empty_like(image)
    for captured, rest, deviation in zip(image, flat, sigma, strict=True):
        saturated = captured >= np.float32(SATURATED_LIGHT)
        np.sqrt(shot * np.maximum(captured, np.float32(0)) + (read + saturated), out=deviation)
        deviation /= np.maximum(rest, np.float32(floor))
    return sigma


light_noise.opencl(grid="H W", lanes="grid", integers="image")


def rest_noise(flat: F4, noise: Noise, floor: float = 0.02) -> F4:
    """Return the standard deviation of the light relative to the film at rest, on that film.

    Light of full scale counts, too: it is that of a flat frame that was not taken.
    """
    shot, read = noise
    deviation = np.sqrt(shot * np.maximum(flat, np.float32(0)) + read)
    return np.asarray(deviation / np.maximum(flat, np.float32(floor)), np.float32)
