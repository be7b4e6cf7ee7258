"""Images of grids as a camera with a lens sees them."""

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4
from tactograph.nodes.optics.lens import half_diagonal, ideal_places

SUB = 4
"""A pixel is the mean of so many by so many samples."""


def on_film(
    shape: tuple[int, int], lens: F4, pitch_px: float, turn: float, shift: tuple[float, float]
) -> tuple[NDArray, NDArray]:
    """Lattice coordinates of samples of an image, SUB by SUB to a pixel."""
    rows, columns = SUB * shape[0], SUB * shape[1]
    x, y = ideal_places(lens, (rows, columns))
    assert half_diagonal((rows, columns)) == SUB * half_diagonal(shape)
    u, v = (x - (columns - 1) / 2) / SUB, (y - (rows - 1) / 2) / SUB
    c, s = np.cos(turn), np.sin(turn)
    return (c * u + s * v) / pitch_px - shift[0], (-s * u + c * v) / pitch_px - shift[1]


def pixels(samples: NDArray, seed: int = 0, noise: float = 0.004) -> F4:
    """8-bit pixels of such samples, with noise, under light that falls off to one side."""
    rows, columns = (size // SUB for size in samples.shape)
    image = samples.reshape(rows, SUB, columns, SUB).mean(axis=(1, 3))
    image *= np.linspace(0.45, 1, columns) * np.linspace(1, 0.8, rows)[:, None]
    image += np.random.default_rng(seed).normal(0, noise, image.shape)
    return np.float32(np.rint(255 * np.clip(image, 0, 1)) / 255)


def dots(i: NDArray, j: NDArray, radius: float = 0.23, bright: bool = False) -> NDArray:
    inside = np.hypot(i - np.rint(i), j - np.rint(j)) < radius
    return np.where(inside == bright, 0.8, 0.15)


def board(i: NDArray, j: NDArray) -> NDArray:
    return np.where((np.floor(i) + np.floor(j)) % 2 == 0, 0.8, 0.15)
