"""Near point lights on a film: the geometry that calibration and measurement share.

A point light at L with strength s lights a Lambertian film of albedo a at P, whose unit normal
is n, with I = a s n.(L - P) / |L - P|^3.  The film at rest (n = z, P_0 = P with z = 0) gives
the flat frame.  Their ratio does not depend on albedo, strength or vignetting::

    I / I_flat = n.v,    v = (L - P) / L_z (|L - P_0| / |L - P|)^3                         (N1)

and no scale remains unknown: |n| = 1.  ``kernels/headers/near_light.clh`` is the same.
"""

from typing import Any

import numpy as np

from tactograph.nodes import F4

UNLIT_LIGHT_SIGMA = 0.5
"""Standard deviation of the light behind the terminator, as a share of its negative value."""
MIN_LIT_SHARE = 0.1
"""Lower bound on the light above a shadow's, as a share of w; light below it is a shadow."""
MIN_WRAP = 1e-9
"""Lower bound on 4 w in a denominator."""
MIN_VIEW_SHARE = np.float32(0.1)
"""Lower bound on a denominator in the camera's view; below 0 film is seen from behind."""


def places(count: int, pixel: np.float32) -> F4:
    """Return the pixels' x, or y, in mm from the middle of the image."""
    middle = np.float32(0.5) * np.float32(count - 1)
    return (np.arange(count, dtype=np.float32) - middle) * pixel


def image_places(shape: tuple[int, ...], pixel: float) -> tuple[F4, F4]:
    """Return x, 1 x W, and y, H x 1, of the pixels of an image H x W: `places`."""
    y, x = (places(side, np.float32(pixel)) for side in shape)
    return x[None], y[:, None]


def lights_around(rng: np.random.Generator, count: int) -> F4:
    """Return LEDs around a film, K x 3 in mm, for generated examples."""
    azimuth = (np.arange(count) + rng.uniform(-0.2, 0.2, count)) * 2 * np.pi / count
    reach, z = rng.uniform(20, 40, count), rng.uniform(30, 60, count)
    lights = np.column_stack([reach * np.cos(azimuth), reach * np.sin(azimuth), z])
    return np.asarray(lights, np.float32)


def light_vectors(lights: F4, height: F4, pixel: float) -> F4:
    """Return v of equation N1, K x 3 x H x W: n.v is the light of a film with normal n, 1 at rest.

    Parameters
    ----------
    lights : K x 3 in mm from the middle of the image
    height : H x W in mm
    pixel : mm per px
    """
    return vectors_at(lights, *image_places(height.shape, pixel), height)


def expected_light(vectors: F4, slope: F4) -> F4:
    """Return n.v of equation N1, K x H x W, for v of K x 3 x H x W and slopes of 2 x H x W."""
    p, q = slope
    nz = np.float32(1) / np.sqrt(np.float32(1) + p * p + q * q)
    return np.asarray((vectors[:, 2] - vectors[:, 0] * p - vectors[:, 1] * q) * nz, np.float32)


def matt_film_light(lights: F4, height: F4, slope: F4, pixel: float) -> F4:
    """Return n.v of equation N1 all over an image, K x H x W: `light_vectors`, `expected_light`."""
    return expected_light(light_vectors(lights, height, pixel), slope)


def wrapped(light: Any, wrap: float) -> Any:
    """Return [.]_w of F1: the light of film that scattered light reaches behind the terminator.

    In front of the terminator it is n.v.  Behind it, the light continues to fall, less and less, to
    -w at n.v = -2 w, where the film is in shadow.  A point light has w = 0.
    """
    behind = np.clip(light, -2 * wrap, 0)
    return np.maximum(light, 0) + behind * (1 + behind / max(4 * wrap, MIN_WRAP))


def unwrapped(light: F4, sigma: F4, wrap: float) -> tuple[F4, F4]:
    """Return the n.v that `wrapped` maps to this light, and its standard deviation.

    Behind the terminator the deviation of the light grows to `UNLIT_LIGHT_SIGMA` of the amount by
    which it is below 0, because w differs from place to place.  In shadow n.v is nearly unknown.
    """
    if wrap == 0:
        return light, sigma
    behind = np.maximum(np.minimum(light, 0), np.float32(-wrap))
    root = np.sqrt(np.maximum(1 + behind / np.float32(wrap), np.float32(MIN_LIT_SHARE)))
    deviation = np.hypot(sigma, np.float32(UNLIT_LIGHT_SIGMA) * behind) / root
    unwrapped_light = np.maximum(light, 0) + np.float32(2 * wrap) * (root - 1)
    return unwrapped_light, np.asarray(deviation, np.float32)


def brightness_share(
    whole: F4, scale: F4 | np.float32 | float, uneven: F4 | np.float32 | float
) -> F4:
    """Return the share of a square along n.v that an unknown brightness explains (Woodbury).

    `whole` is the sum of the squares of n.v over their variances, times `scale`; `uneven` is the
    standard deviation of the brightness.
    """
    square = uneven * uneven
    return np.asarray(square / (scale + square * whole), np.float32)


def vectors_at(lights: F4, x: F4, y: F4, z: F4) -> F4:
    """Return v of equation N1 at places in mm from the middle of the image, K x 3 x ..."""
    vectors = np.empty((len(lights), 3, *z.shape), np.float32)
    for vector, (lx, ly, lz) in zip(vectors, lights, strict=True):
        dx, dy, dz = lx - x, ly - y, lz - z
        gain = _gain(dx * dx + dy * dy, dz, lz)
        for component, away in zip(vector, (dx, dy, dz), strict=True):
            np.multiply(away, gain, out=component)
    return vectors


def light_by_place(lights: F4, x: F4, y: F4, z: F4, slope: F4) -> F4:
    """Return the derivative of n.v by each LED's position, K x 3 x ..., per mm."""
    p, q = slope
    nz = np.float32(1) / np.sqrt(np.float32(1) + p * p + q * q)
    by_place = np.empty((len(lights), 3, *z.shape), np.float32)
    for by, (lx, ly, lz) in zip(by_place, lights, strict=True):
        dx, dy, dz = lx - x, ly - y, lz - z
        plan = dx * dx + dy * dy
        gain = _gain(plan, dz, lz) * nz
        at_rest, pressed = np.float32(1) / (plan + lz * lz), np.float32(1) / (plan + dz * dz)
        thrice = np.float32(3) * gain * (dz - dx * p - dy * q)
        by[0] = thrice * dx * (at_rest - pressed) - gain * p
        by[1] = thrice * dy * (at_rest - pressed) - gain * q
        by[2] = thrice * (lz * at_rest - dz * pressed - np.float32(1 / 3) / lz) + gain
    return by_place


def _gain(plan: F4, dz: F4, lz: np.float32) -> F4:
    """The factor on L - P in v of equation N1; `plan` is its squared length in the plane."""
    return np.asarray(irradiance_ratio(plan + lz * lz, plan + dz * dz) * (np.float32(1) / lz))


def irradiance_ratio(at_rest: Any, pressed: Any) -> Any:
    """Return (|L - P_0| / |L - P|)^3 of equation N1 from the squares of both distances."""
    nearer = at_rest / pressed
    return nearer * np.sqrt(nearer)
