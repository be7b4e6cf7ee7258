"""Presses of a ball on an elastic layer, by integrals that know nothing of pixels."""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.fft import dctn, idctn
from scipy.special import j0, j1

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


def distance(shape: tuple[int, int] = SHAPE, pixel: float = PIXEL) -> F8:
    """From the middle of the frame, mm."""
    y, x = (pixel * (i - (n - 1) / 2) for i, n in zip(np.indices(shape), shape, strict=True))
    return np.asarray(np.hypot(x, y))


def displaced(
    thickness: float, poisson: float, places: F8, radius: float = RADIUS, peak: float = PEAK
) -> tuple[F8, F8]:
    """How far that pressure moves the layer's face in and outwards, at N distances from its middle;
    mm: its Hankel transform times the compliance."""
    k = np.linspace(1e-3, 150 / radius, 20_001)
    load = peak * (np.sin(k * radius) - k * radius * np.cos(k * radius)) / (k**3 * radius)
    answer, waves = layer_compliance(k, thickness, poisson), load / MODULUS * k
    inwards = [np.trapezoid(waves * answer.normal * j0(k * place), k) for place in places]
    outwards = [-np.trapezoid(waves * answer.coupled * j1(k * place), k) for place in places]
    return np.array(inwards), np.array(outwards)


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


@cache
def height(
    thickness: float, poisson: float, radius: float = RADIUS, peak: float = PEAK,
    shape: tuple[int, int] = SHAPE, pixel: float = PIXEL,
) -> F4:  # fmt: skip
    """The film as a camera sees it: each point where the press has moved it to."""
    away = distance(shape, pixel)
    places = np.linspace(0, 1.2 * away.max(), 400)
    inwards, outwards = displaced(thickness, poisson, places, radius, peak)
    return np.float32(np.interp(away, places + outwards, inwards))


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
