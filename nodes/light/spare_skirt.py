"""Leave the skirt of a touch in the light, which `film_drift` takes for drift of the LEDs."""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from scipy.special import fdtri

from tactograph.graph import Port, node
from tactograph.nodes import F4, FALSE_ALARMS, CoarseLight, LightPositions, PixelSize
from tactograph.nodes.light.film_drift import DRIFT_TERMS, Drift, drift_gain, terms
from tactograph.nodes.optics.near_light import image_places

SKIRT_POWERS = (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)
"""Exponents of u and v of the surfaces whose slopes change light as the shape of a drift does."""
COMPARED_PLACES = 16
"""Places along the shorter side at which light is compared; any more tell the same."""
SkirtSurface = Annotated[F4, Port("7", "mm")]
"""Coefficients of the terms u^i v^j of `SKIRT_POWERS`; u and v as for `Drift`."""


class Spared(NamedTuple):
    """The drift of the LEDs alone, and the surface whose light was taken out of it."""

    drift: Drift
    surface: SkirtSurface


@node
def spare_skirt(
    drift: Drift,
    lights: LightPositions,
    pixel: PixelSize,
    light: CoarseLight,
    *,
    false_alarms: float = FALSE_ALARMS,
) -> Spared:
    """Return a drift without what looks like the skirt of a touch.

    A skirt as wide as the frame makes light uneven, as drift does.  But it changes the light of all
    LEDs by the slopes of one surface, while each LED drifts by itself: without levels the drifts of
    K LEDs have 5 K terms, of which seven surfaces explain seven.  If the surface that explains most
    explains more than chance would but once in 1 / `false_alarms` times, by the variance of the
    other terms (the F test), it is a skirt, and its light stays, by the share that it explains
    beyond chance.

    Parameters
    ----------
    drift : K x 6, from `film_drift`
    lights : K x 3 in mm
    pixel : mm per px of `light`
    light : K x H x W, for the size of the image
    false_alarms : share of drifts of the LEDs alone that may be taken for a skirt

    Returns
    -------
    K x 6, and 7 coefficients in mm, all 0 if there is no skirt.
    """
    count, none = len(SKIRT_POWERS), np.zeros(len(SKIRT_POWERS), np.float32)
    others = (DRIFT_TERMS - 1) * len(drift) - count
    if not drift[:, 1:].any() or others < 1:
        return Spared(drift, none)
    every = math.ceil(min(light.shape[1:]) / COMPARED_PLACES)
    small, step = tuple(-(-side // every) for side in light.shape[1:]), float(pixel) * every
    surfaces = [skirt_on(small, np.eye(count)[n]) for n in range(count)]
    down, across = np.gradient(surfaces, step, axis=(1, 2), edge_order=2)
    (x, y), (x_led, y_led, z_led) = image_places(small, step), lights.T[:, :, None, None]
    lit = across[:, None] * (x - x_led) / z_led + down[:, None] * (y - y_led) / z_led
    looks, found = (_uneven(each) for each in (lit, drift_gain(drift, small)))
    looks = looks.reshape(count, -1)
    surface = np.linalg.lstsq(looks.T, found.ravel())[0]
    skirt = surface @ looks
    by_chance = np.square(found.ravel() - skirt).mean() * count / others
    if np.square(skirt).mean() < fdtri(count, others, 1 - false_alarms) * by_chance:
        return Spared(drift, none)
    share = 1 - by_chance / np.square(skirt).mean()
    basis = terms(small).reshape(DRIFT_TERMS, -1)
    change = np.linalg.lstsq(basis.T, share * skirt.reshape(len(drift), -1).T)[0]
    return Spared(np.asarray(drift - change.T, np.float32), np.asarray(surface, np.float32))


def skirt_on(shape: tuple[int, ...], surface: Any) -> F4:
    """Return the height of a surface over an image: H x W in mm."""
    u, v = image_places(shape, 2 / shape[1])
    return sum(c * u**i * v**j for c, (i, j) in zip(surface, SKIRT_POWERS, strict=True))


def _uneven(light: F4) -> F4:
    """Light without the mean of each image."""
    return light - light.mean((-2, -1), keepdims=True)
