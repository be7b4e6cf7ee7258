"""The random errors that `height_error` propagates: their signs, waves and draws.

``kernels/error/height_error.cl`` computes the same.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import hadamard

from tactograph.nodes import F4, OTHER_PLACES as ERROR_COUNT

LED_SIGNS = hadamard(ERROR_COUNT).astype(np.float32)
"""Signs of an error of each single LED, by error and LED."""
*_, BOUNCE_SIGNS, SETTLING_SIGNS, LEAN_SIGNS, RISE_SIGNS, MEAN_SIGNS = LED_SIGNS
"""Orthogonal signs of the errors that every random error contains in full, so that they do not
interfere; the fourth LED and the bounced light share a row."""
WAVE_LENGTHS = 4.0, 12.0
"""Lengths of the waves, relative to the width of the model's errors, at which the correlation of
the first has fallen to a half."""


class Wave(NamedTuple):
    """A wave of the model's errors: its direction, its phase, and its length over their width."""

    across: np.float32
    down: np.float32
    phase: np.float32
    length: np.float32


def wave(number: int) -> Wave:
    """The wave of an error; each odd error is a quarter of a wave ahead of the even one before."""
    angle, phase = number // 2 * math.pi / 4, number % 2 * math.pi / 2
    numbers = math.cos(angle), math.sin(angle), phase, WAVE_LENGTHS[number // 2 % 2]
    return Wave(*map(np.float32, numbers))


def kinds() -> F4:
    """Return the parameters of each error for the device (`Kind` of the kernel)."""
    waves = np.array([wave(number) for number in range(ERROR_COUNT)], np.float32)
    waves[:, 2] /= np.float32(2 * math.pi)
    return np.column_stack([BOUNCE_SIGNS, SETTLING_SIGNS, LEAN_SIGNS, MEAN_SIGNS, waves])


def key_of(seed: int, number: int) -> int:
    """The key of the hash that draws the random signs of an error."""
    return int(_hashed(np.uint32((ERROR_COUNT * seed + number + 1) % 2**32)))


def drawn(key: int, shape: tuple[int, ...], first: int = 0) -> F4:
    """Draw +1 or -1 for each element by a hash, so that all devices draw the same.

    Elements are counted from `first`.  Only the variance of the draws matters, which is 1.
    """
    numbers = np.arange(first, first + math.prod(shape), dtype=np.uint32) ^ np.uint32(key)
    return np.where(_hashed(numbers) >> np.uint32(31), np.float32(1), np.float32(-1)).reshape(shape)


def _hashed(x: Any) -> Any:
    """Hash a 32-bit number: every bit depends on all bits of `x` (C. Wellons, lowbias32)."""
    with np.errstate(over="ignore"):
        x = (x ^ x >> np.uint32(16)) * np.uint32(0x7FEB352D)
        x = (x ^ x >> np.uint32(15)) * np.uint32(0x846CA68B)
    return x ^ x >> np.uint32(16)
