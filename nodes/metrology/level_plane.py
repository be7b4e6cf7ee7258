"""Turn and shift a height map until its level parts lie in the plane z = 0."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError, node, warn
from tactograph.nodes import F4, Height
from tactograph.nodes.files.image_files import read_image

MAX_FITTED = 200_000
"""Pixels that the plane is fitted to; more add nothing."""
ROUNDS = 30
ROBUST_WIDTH = 2.0
"""Residual, over the median of all, from which a pixel counts less (Cauchy's weight)."""
MIN_SPREAD = 1e-6
"""Median residual in mm below which all counts alike."""


@node(neutral="height")
def level_plane(height: Height, *, mask: Path | None = None) -> Height:
    """Subtract a plane: where nothing is at rest, slopes tell neither the zero nor the tilt.

    Without a mask the plane follows what most of the film agrees on: least squares, reweighted
    by Cauchy's function, from the largest scale downwards.

    Parameters
    ----------
    height
        H x W in mm.
    mask
        An image of the same size, not 0 where the surface is known to be level.

    Raises
    ------
    InputError
        If the mask cannot be read, has another size, or shows fewer than three pixels.
    """
    rows, columns = height.shape
    known = np.isfinite(height) if mask is None else _level_part(mask, height)
    y, x = np.nonzero(known)
    if len(x) < 3:
        warn("fewer than three pixels are known: the height stays as it is")
        return height
    every = slice(None, None, max(1, len(x) // MAX_FITTED))
    u, v = (x[every] - columns / 2) / columns, (y[every] - rows / 2) / rows
    terms = np.stack([np.ones_like(u), u, v], axis=1)
    plane = _robust_plane(terms, height[known][every].astype(float), robust=mask is None)
    across = ((np.arange(columns) - columns / 2) / columns)[None]
    down = ((np.arange(rows) - rows / 2) / rows)[:, None]
    return (height - (plane[0] + plane[1] * across + plane[2] * down)).astype(np.float32)


def _level_part(file: Path, height: F4) -> NDArray[np.bool_]:
    mask = read_image(file)
    marked: NDArray[np.bool_] = (mask if mask.ndim == 2 else mask.max(axis=2)) > 0
    if marked.shape != height.shape:
        raise InputError(
            f"{file}: is {marked.shape[1]} x {marked.shape[0]} px, the height "
            f"{height.shape[1]} x {height.shape[0]}"
        )
    marked &= np.isfinite(height)
    if marked.sum() < 3:
        raise InputError(f"{file}: marks fewer than three pixels of known height as level")
    return marked


def _robust_plane(
    terms: NDArray[np.float64], z: NDArray[np.float64], robust: bool
) -> NDArray[np.float64]:
    plane = np.linalg.lstsq(terms, z, rcond=None)[0]
    for _ in range(ROUNDS if robust else 0):
        rest = np.abs(z - terms @ plane)
        scale = ROBUST_WIDTH * np.median(rest)
        if scale < MIN_SPREAD:
            break
        root = 1 / np.sqrt(1 + (rest / scale) ** 2)
        before, plane = plane, np.linalg.lstsq(terms * root[:, None], z * root, rcond=None)[0]
        if np.abs(plane - before).max() < MIN_SPREAD:
            break
    return np.asarray(plane)
