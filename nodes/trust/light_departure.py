"""Departure of each pixel's light from what its slope predicts."""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval

from tactograph.graph import Flips, Port, SizeLimit, node
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
    Wrap,
)
from tactograph.nodes.optics.near_light import (
    brightness_share,
    expected_light,
    light_vectors,
)
from tactograph.nodes.trust._check import DARK_AS_DUE, NOT_TESTED

Departure = Annotated[F4, Port("H W", "1", low=-1, high=25)]
"""Reduced chi-squared of a pixel's light; below 0 where too few LEDs test the slope."""
Brighter = Annotated[F4, Port("H W", "1", low=-1, high=1)]
"""How much brighter film is than its slopes make it, as a share (T4)."""
MIN_MODEL_LIGHT = np.float32(0.1)
"""Light below which the model's error no longer falls with the light."""
MIN_ERROR = 0.0015
"""Standard deviation of the light, relative to film at rest: no model is exact."""
MIN_FREEDOM = np.float32(0.5)
"""Fewer degrees of freedom test nothing: two LEDs fit any light exactly."""
UNEVEN_SHARE = 0.25
"""Share of the film's unevenness that differs from LED to LED."""
MIN_SQUARES = np.float32(1e-6)
"""Sum of squares of light that is divided by."""


class LightDeparture(NamedTuple):
    """How light departs from its model."""

    departure: Departure
    brighter: Brighter


def light_error(misfit: Misfit | None, uneven: float) -> float:
    """Return the standard deviation of the model's light, relative to film at rest."""
    pressed = 0.0 if misfit is None else misfit.item(2)
    return math.hypot(max(pressed, MIN_ERROR), UNEVEN_SHARE * uneven)


@node(
    sizes={"K": SizeLimit(3, 8, "two LEDs fit any light, a label has 8 bits")},
    tolerance=Flips(1e-3, 1e-3, 2e-3, why="degrees of freedom at the limit of a test"),
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
    wrap: Wrap | None = None,
    *,
    cell_px: Annotated[int, Interval(ge=1, le=64)] = 1,
) -> LightDeparture:
    """Return the reduced chi-squared of the light under the slope that was found, and its excess.

    With r_k = (m_k - n.v_k) / s_k of equation N1 (`near_light`) and a_k = n.v_k / s_k, over the
    LEDs that were used::

        chi^2 = sum (r_k - b a_k)^2,    b = sum r_k a_k / (sum a_k^2 + 1 / uneven^2)
        s_k^2 = (sigma_k / cell_px)^2 + (e max(n.v_k, 0.1))^2                                (T1)

    b is the film's unknown brightness, and e the model's error of the light (`light_error`), from
    the presses of the calibration.  The degrees of freedom are the LEDs used, less two for the
    slope and less the share of the brightness that was free.  Where fewer LEDs were used than a
    test needs, the departure is -1.  In a gel that scatters light an LED behind the soft terminator
    is hardly known, so that it is not used; but it is dark because the slope turns away from it.
    Where such LEDs make up for what the test lacks, the departure is -0.5.  The excess is that of
    the film's brightness as the light itself has it, sum m_k n.v_k / sum (n.v_k)^2 - 1 (T4).

    Parameters
    ----------
    light, sigma : K x H x W, as of a matt film (`matt_light`)
    slope, used : 2 x H x W and H x W, as `label_lights` found them
    height : H x W in mm, as given to `label_lights`
    lights : K x 3 in mm
    misfit : length 5, the calibration's misfit
    pixel : mm per px
    uneven : standard deviation of the film's brightness, as given to `label_lights`
    wrap : how far light goes on falling behind the terminator, as given to `label_lights`
    cell_px : side in px of the cells that the light is a mean of; `sigma` is that of a single pixel
    """
    shown = expected_light(light_vectors(lights, height, pixel), slope)
    bits = np.arange(len(light), dtype=np.uint8)[:, None, None]
    lit = (used >> bits & 1).astype(np.float32)
    noise = sigma * np.float32(1 / cell_px)
    model = np.float32(light_error(misfit, uneven)) * np.maximum(shown, MIN_MODEL_LIGHT)
    weight = lit / (noise * noise + model * model)
    departs, along = light - shown, shown * weight
    whole = (shown * along).sum(axis=0)
    share = brightness_share(whole, np.float32(1), np.float32(uneven))
    left = departs - (departs * along).sum(axis=0) * share * shown
    freedom = lit.sum(axis=0) - np.float32(2) - share * whole
    reduced = (weight * left * left).sum(axis=0) / np.maximum(freedom, MIN_FREEDOM)
    seen, due = (light * shown * lit).sum(axis=0), (shown * shown * lit).sum(axis=0)
    turned_away = (shown < 0).sum(axis=0, where=lit == 0) if wrap else np.float32(0)
    other = np.where(freedom + turned_away >= MIN_FREEDOM, DARK_AS_DUE, NOT_TESTED)
    chi = np.where(freedom >= MIN_FREEDOM, reduced, other)
    return LightDeparture(np.asarray(chi, np.float32), seen / np.maximum(due, MIN_SQUARES) - 1)


light_departure.opencl(grid="H W", lanes="grid")


@light_departure.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """LEDs around a film whose light departs from the model by a few standard deviations."""
    around = np.arange(K) * 2 * np.pi / K
    lights = np.stack([20 * np.cos(around), 20 * np.sin(around), 0 * around + 25], axis=1)
    slope = rng.uniform(-1.2, 1.2, (2, H, W)).astype(np.float32)
    height = rng.uniform(0, 0.5, (H, W)).astype(np.float32)
    vectors = light_vectors(lights.astype(np.float32), height, 0.05)
    light = expected_light(vectors, slope) + rng.normal(0, 0.02, (K, H, W))
    return {
        "light": light.astype(np.float32),
        "sigma": rng.uniform(0.005, 0.02, (K, H, W)).astype(np.float32),
        "slope": slope,
        "height": height,
        "used": rng.integers(0, 1 << K, (H, W)).astype(np.uint8),
        "lights": lights.astype(np.float32),
        "misfit": np.array([0.003, 1, 0.004, 0.05, 0.002], np.float32),
        "pixel": 0.05,
        "wrap": float(rng.choice([0, 0.2])),
    }
