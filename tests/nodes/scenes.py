"""Small scenes whose truth is known in closed form."""

import numpy as np

from tactograph.nodes import F4

LIGHTS = np.array(
    [[0.4, 0.3, 0.87], [-0.3, 0.4, 0.87], [-0.4, -0.3, 0.87], [0.3, -0.4, 0.87]], np.float32
)
"""Unit directions to four distant LEDs, about 30 degrees from the axis."""


def lambert(slope: F4, lights: F4 = LIGHTS) -> F4:
    """The light of a Lambertian film of albedo 1 under distant LEDs; black where none falls."""
    p, q = slope
    normal = np.stack([-p, -q, np.ones_like(p)]) / np.sqrt(1 + p * p + q * q)
    return np.maximum(np.tensordot(lights, normal, axes=1), 0).astype(np.float32)


def ball(height: int, width: int, radius: float) -> tuple[F4, F4]:
    """A cap of a ball of `radius` px over the whole frame: height in px, and slope."""
    y, x = np.mgrid[:height, :width].astype(np.float64)
    x -= (width - 1) / 2
    y -= (height - 1) / 2
    z = np.sqrt(radius**2 - x * x - y * y)
    return z.astype(np.float32), np.stack([-x / z, -y / z]).astype(np.float32)


def waves(height: int, width: int) -> tuple[F4, F4]:
    """A smooth surface that does not return to its start at the border, and its slope."""
    y, x = np.mgrid[:height, :width].astype(np.float64)
    u, v = 2.2 / width, 1.7 / height
    z = 8 * np.sin(u * x + 0.4) + 5 * np.cos(v * y) + 0.02 * x + 3 * np.sin(u * x) * np.sin(v * y)
    p = 8 * u * np.cos(u * x + 0.4) + 0.02 + 3 * u * np.cos(u * x) * np.sin(v * y)
    q = -5 * v * np.sin(v * y) + 3 * v * np.sin(u * x) * np.cos(v * y)
    return z.astype(np.float32), np.stack([p, q]).astype(np.float32)
