"""Departure of each pixel's light from what a one-shot sensor's reflectance map predicts."""

from typing import Any

import numpy as np

from tactograph.rings.oneshot.nodes.map.mapped_light import mapped_light
from tactograph.rings.oneshot.nodes.map.reflectance_map import ReflectanceMap, rough_film
from tactograph.sdk import F4, Close, Height, Light, LightDeparture, Misfit, SizeLimit, Slope, node

MIN_MAP_ERROR = 0.007
"""Standard deviation of the light: a map of harmonics is coarser than a film's model."""


@node(
    sizes={"K": SizeLimit(3, 8, "two lights fit any slope, and labels have 8 bits")},
    tolerance=Close(1e-3, 2e-3, why="squares of differences of rounded light"),
)
def map_departure(
    light: Light,
    slope: Slope,
    height: Height,
    reflectance: ReflectanceMap,
    misfit: Misfit,
) -> LightDeparture:
    """Return the reduced chi-squared of the light under the slope that was found, and its excess.

    The sum over the lights of the square of what equation M1 leaves, over the square of the
    model's error and the K - 2 degrees of freedom (equation T1).  The excess is that of
    equation T4.

    Parameters
    ----------
    light : K x H x W, relative to the film at rest
    slope, height : 2 x H x W, and H x W in mm, as given to `solve_reflectance_map`
    reflectance : K x 9 x 15, as `fit_reflectance_map` gives it
    misfit : length 5, the calibration's misfit
    """
    model_light = mapped_light(slope, height, reflectance)
    residual = light - model_light
    freedom = np.float32(len(light) - 2)
    error = max(float(misfit[2]), MIN_MAP_ERROR)
    scale = np.float32(1 / error**2) / freedom
    return LightDeparture.of((residual * residual).sum(axis=0) * scale, light, model_light)


map_departure.opencl(grid="H W", lanes="rows")


@map_departure.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """A rough film whose light departs from its map's by some per cent."""
    film = rough_film(rng, K, H, W)
    light: F4 = mapped_light(**film)
    departed = (light + rng.normal(0, 0.03, light.shape)).astype(np.float32)
    return {**film, "light": departed, "misfit": np.array([0.05, 0, 0.02, 0, 0], np.float32)}
