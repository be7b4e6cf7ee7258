"""Presses of a ball on an elastic layer, by integrals that know nothing of pixels."""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dctn, idctn
from scipy.special import j0

from tactograph.nodes import F4
from tactograph.nodes.force.elastic_layer import layer_compliance, wave_numbers

PIXEL = 0.1
SHAPE = (120, 160)
RADIUS = 1.6
"""Of the contact, mm."""
PEAK = 40.0
"""Pressure in the middle of the contact, kPa."""
MODULUS = 200.0
FORCE = 2e-3 / 3 * np.pi * RADIUS**2 * PEAK
"""Of a ball's pressure p0 sqrt(1 - r^2 / a^2), N."""


def distance() -> NDArray[np.float64]:
    """From the middle of the frame, mm."""
    rows, columns = SHAPE
    y, x = PIXEL * (
        np.indices(SHAPE) - np.array([(rows - 1) / 2, (columns - 1) / 2])[:, None, None]
    )
    return np.asarray(np.hypot(x, y))


def displacement(
    thickness: float, poisson: float, r: NDArray[np.float64] | None = None, radius: float = RADIUS
) -> NDArray[np.float64]:
    """Of the layer's face under that pressure: its Hankel transform times the compliance."""
    k = np.linspace(1e-3, 150 / radius, 60_001)
    load = PEAK * (np.sin(k * radius) - k * radius * np.cos(k * radius)) / (k**3 * radius)
    waves = load * layer_compliance(k, thickness, poisson) / MODULUS * k
    places = np.linspace(0, distance().max(), 300)
    along = np.array([np.trapezoid(waves * j0(k * place), k) for place in places])
    return np.asarray(np.interp(distance() if r is None else r, places, along))


def noise(rng: np.random.Generator, deviation: float) -> NDArray[np.float64]:
    """What integrated slopes err by, the border at zero."""
    waves = dctn(rng.normal(size=SHAPE), norm="ortho")
    k = wave_numbers(SHAPE, PIXEL)
    plane = idctn(np.divide(waves, k, out=np.zeros(SHAPE), where=k > 0), norm="ortho")
    plane *= deviation / plane.std()
    return np.asarray(plane - np.median(plane[[0, -1]]))


def contact() -> NDArray[np.uint8]:
    """A contact a little wider than the true one."""
    return (distance() < 1.2 * RADIUS).astype(np.uint8)


def height(thickness: float, poisson: float) -> F4:
    return displacement(thickness, poisson).astype(np.float32)
