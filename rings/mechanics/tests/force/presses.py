"""Presses of a ball on an elastic layer, by integrals that know nothing of pixels."""

from typing import NamedTuple

import numpy as np
from scipy.fft import dctn, idctn
from scipy.special import j0

from tactograph.nodes import F4, F8, U1
from tactograph.rings.mechanics.nodes.force.elastic_layer import layer_compliance, wave_numbers

PIXEL = 0.1
SHAPE = (120, 160)
RADIUS = 1.6
"""Of the contact, mm."""
PEAK = 40.0
"""Pressure in the middle of the contact, kPa."""
MODULUS = 200.0
FORCE = 2e-3 / 3 * np.pi * RADIUS**2 * PEAK
"""Of a ball's pressure p0 sqrt(1 - r^2 / a^2), N."""


def distance() -> F8:
    """From the middle of the frame, mm."""
    rows, columns = SHAPE
    y, x = PIXEL * (
        np.indices(SHAPE) - np.array([(rows - 1) / 2, (columns - 1) / 2])[:, None, None]
    )
    return np.asarray(np.hypot(x, y))


def displacement(
    thickness: float, poisson: float, r: F8 | None = None, radius: float = RADIUS
) -> F8:
    """Of the layer's face under that pressure: its Hankel transform times the compliance."""
    k = np.linspace(1e-3, 150 / radius, 60_001)
    load = PEAK * (np.sin(k * radius) - k * radius * np.cos(k * radius)) / (k**3 * radius)
    waves = load * layer_compliance(k, thickness, poisson).normal / MODULUS * k
    places = np.linspace(0, distance().max(), 300)
    along = np.array([np.trapezoid(waves * j0(k * place), k) for place in places])
    return np.asarray(np.interp(distance() if r is None else r, places, along))


def noise(rng: np.random.Generator, deviation: float) -> F8:
    """What integrated slopes err by, the border at zero."""
    waves = dctn(rng.normal(size=SHAPE), norm="ortho")
    k = wave_numbers(SHAPE, PIXEL)
    plane = idctn(np.divide(waves, k, out=np.zeros(SHAPE), where=k > 0), norm="ortho")
    plane *= deviation / plane.std()
    return np.asarray(plane - np.median(plane[[0, -1]]))


def contact() -> U1:
    """A contact a little wider than the true one."""
    return (distance() < 1.2 * RADIUS).astype(np.uint8)


def height(thickness: float, poisson: float) -> F4:
    return displacement(thickness, poisson).astype(np.float32)


class Face(NamedTuple):
    """Displacement of the layer's face in mm: towards the window, along x, along y."""

    z: F8
    x: F8
    y: F8


def face(
    pressure: F8, shear_x: F8, shear_y: F8, pixel: float, thickness: float, poisson: float
) -> Face:
    """Displacements by tractions that repeat beyond the frame."""
    rows, columns = pressure.shape
    v = 2 * np.pi * np.fft.fftfreq(rows, pixel)[:, None]
    u = 2 * np.pi * np.fft.fftfreq(columns, pixel)[None]
    k = np.hypot(u, v)
    u, v = (wave / np.maximum(k, 1e-9) for wave in (u, v))
    u[0, 0] = 1  # the mean is sheared in any direction alike
    answer = layer_compliance(k, thickness, poisson)
    p, x, y = (np.fft.fft2(plane) for plane in (pressure, shear_x, shear_y))
    along, across = u * x + v * y, u * y - v * x
    i_p, i_along = 1j * answer.coupled * p, 1j * answer.coupled * along
    along, across = answer.along * along + i_p, answer.across * across
    waves = answer.normal * p - i_along, u * along - v * across, v * along + u * across
    return Face(*(np.fft.ifft2(wave).real / MODULUS for wave in waves))
