"""Compare each pixel's light with the prediction of its slope."""

import math
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from annotated_types import Interval

from tactograph.graph import Close, Port, SizeLimit, node
from tactograph.nodes import (
    F4,
    Height,
    Labels,
    Light,
    LightPositions,
    Misfit,
    PixelSize,
    Slope,
    Uneven,
)
from tactograph.nodes.optics.near_light import brightness_share, lights_around, matt_film_light
from tactograph.nodes.trust.checked_cells import DARK_LIGHT, MIN_LIGHT, NOT_TESTED

Departure = Annotated[F4, Port("H W", "1", low=-1, high=25)]
"""Reduced chi-squared of a pixel's light; -1 where too few LEDs test the slope."""
Brighter = Annotated[F4, Port("H W", "1", low=-1, high=1)]
"""By which share film is brighter than its slopes predict (T4)."""
MIN_ERROR = 0.0015
"""Smallest model error of the light, relative to film at rest: no model is exact."""
UNEVEN_SHARE = 0.25
"""Share of the film's unevenness that differs from LED to LED."""
MIN_FREEDOM = np.float32(0.5)
"""Fewer degrees of freedom test nothing: two LEDs fit any light exactly."""


class LightDeparture(NamedTuple):
    """The departure of the light from its model, and the excess of the brightness."""

    departure: Departure
    brighter: Brighter

    @classmethod
    def of(cls, departure: F4, light: F4, model: F4, lit: F4 | float = 1.0) -> Self:
        """Return a departure with the excess of the film's brightness (T4).

        Parameters
        ----------
        departure : H x W
        light, model : K x H x W, the light, and the prediction of the slopes
        lit : K x H x W, 1 where an LED was used
        """
        measured, due = (light * model * lit).sum(axis=0), (model * model * lit).sum(axis=0)
        excess = measured / np.maximum(due, MIN_LIGHT) - 1
        return cls(np.asarray(departure, np.float32), np.asarray(excess, np.float32))


@node(
    sizes={"K": SizeLimit(3, 8, "two LEDs fit any light, a label has 8 bits")},
    tolerance=Close(1e-3, 2e-3, share=1e-3, why="degrees of freedom at the limit of a test"),
)
def light_departure(
    light: Light,
    sigma: Light,
    slope: Slope,
    height: Height,
    used: Labels,
    lights: LightPositions,
    misfit: Misfit,
    pixel: PixelSize,
    uneven: Uneven,
    *,
    cell_px: Annotated[int, Interval(ge=1, le=64)] = 1,
) -> LightDeparture:
    """Return the reduced chi-squared of the light given the slope, and the excess brightness.

    With r_k = (m_k - n.v_k) / s_k of equation N1 (`near_light`) and a_k = n.v_k / s_k, summed over
    the LEDs that were used::

        chi^2 = sum (r_k - b a_k)^2,    b = sum r_k a_k / (sum a_k^2 + 1 / uneven^2)
        s_k^2 = (sigma_k / cell_px)^2 + (e max(n.v_k, 0.05))^2                               (T1)

    b is the film's unknown brightness.  e is the model's error of the light: that of the
    calibration's presses, at least `MIN_ERROR`, and a quarter of `uneven`, in quadrature.  The
    degrees of freedom are the number of LEDs used, minus two for the slope, minus the share of the
    brightness that was free.  Where they are too few for a test, the departure is -1.  The excess
    of the film's brightness is sum m_k n.v_k / sum (n.v_k)^2 - 1 (T4).

    Parameters
    ----------
    light, sigma : K x H x W, as of a matt film (`matt_light`)
    slope, used : 2 x H x W and H x W, from `label_lights`
    height : H x W in mm, as given to `label_lights`
    lights : K x 3 in mm
    misfit : length 5, the calibration's misfit
    pixel : mm per px
    uneven : standard deviation of the film's brightness, as given to `label_lights`
    cell_px : side in px of the cells that `light` is averaged over; `sigma` is a single pixel's
    """
    model_light = matt_film_light(lights, height, slope, pixel)
    bits = np.arange(len(light), dtype=np.uint8)[:, None, None]
    lit = (used >> bits & 1).astype(np.float32)
    noise = sigma * np.float32(1 / cell_px)
    error = math.hypot(max(misfit.item(2), MIN_ERROR), UNEVEN_SHARE * uneven)
    model = np.float32(error) * np.maximum(model_light, DARK_LIGHT)
    weight = lit / (noise * noise + model * model)
    departs, along = light - model_light, model_light * weight
    whole = (model_light * along).sum(axis=0)
    share = brightness_share(whole, np.float32(1), np.float32(uneven))
    residual = departs - (departs * along).sum(axis=0) * share * model_light
    freedom = lit.sum(axis=0) - np.float32(2) - share * whole
    reduced = (weight * residual * residual).sum(axis=0) / np.maximum(freedom, MIN_FREEDOM)
    chi = np.where(freedom >= MIN_FREEDOM, reduced, NOT_TESTED)
    return LightDeparture.of(chi, light, model_light, lit)


light_departure.opencl(grid="H W", lanes="grid")


@light_departure.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """LEDs around a film whose light departs from the model by a few standard deviations."""
    lights = lights_around(rng, K)
    slope = rng.uniform(-1.2, 1.2, (2, H, W)).astype(np.float32)
    height = rng.uniform(0, 0.5, (H, W)).astype(np.float32)
    model_light = matt_film_light(lights, height, slope, 0.05)
    light = model_light + rng.normal(0, 0.02, (K, H, W))
    return {
        "light": light.astype(np.float32),
        "sigma": rng.uniform(0.005, 0.02, (K, H, W)).astype(np.float32),
        "slope": slope,
        "height": height,
        "used": rng.integers(0, 1 << K, (H, W)).astype(np.uint8),
        "lights": lights,
        "misfit": np.array([0.003, 1, 0.004, 0.05, 0.002], np.float32),
        "pixel": 0.05,
    }
