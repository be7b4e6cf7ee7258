"""Turn and shift a height map until its level parts lie in the plane z = 0."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError, node, warn
from tactograph.nodes import F8, Height
from tactograph.nodes.files.image_files import read_image

MAX_FITTED = 50_000
"""Pixels that the plane is fitted to; more add nothing."""
FIT_ROUNDS = 30
ROBUST_WIDTH = 2.0
"""Residual, over the median of all, from which a pixel counts less (Cauchy's weight)."""
MIN_SPREAD = 1e-6
"""Smallest residual in mm from which on a pixel counts less, and smallest change of a plane."""
REST_BORDER_SHARE = 0.02
"""Share of the shorter side that is at rest around the frame, where film at rest is named."""


@node(neutral="height")
def level_plane(height: Height, *, level: str = "plane") -> Height:
    """Subtract a plane: where nothing is at rest, slopes tell neither the zero nor the tilt.

    Parameters
    ----------
    height : H x W in mm
    level
        ``plane``: what most of the film agrees on, by least squares, reweighted by Cauchy's
        function from the largest scale downwards.  ``rest``: the frame's border, if the film is
        at rest there.  Else an image of the same size, not 0 where the surface is level.

    Raises
    ------
    InputError
        If the image cannot be read, has another size, or shows fewer than three pixels.
    """
    rows, columns = height.shape
    marked = level_part(level, (rows, columns))
    step = max(1, int(np.sqrt(height.size / MAX_FITTED)))
    for every in (slice(None, None, step), slice(None)):
        counts = np.isfinite(height[every, every])
        if marked is not None:
            counts &= marked[every, every]
        if counts.sum() >= 3:
            break
    else:
        if marked is not None:
            raise InputError(f"{level}: marks fewer than three pixels of known height as level")
        warn("fewer than three pixels are known: the height stays as it is")
        return height
    one, across, down = plane_terms(rows, columns)
    there = one, across[:, every], down[every]
    sampled = np.stack([np.broadcast_to(term, counts.shape)[counts] for term in there], 1)
    z = height[every, every][counts].astype(float)
    weights = plane_weights(sampled, z) if marked is None else np.ones_like(z)
    zero, right, below = weighted_plane(sampled, z, weights)
    found = height - (zero + right * across).astype(np.float32)
    found -= (below * down).astype(np.float32)
    return found


def level_part(level: str, shape: tuple[int, int], cell: int = 1) -> NDArray[np.bool_] | None:
    """The pixels that are named as level, or one pixel of every cell; None where none are named."""
    if level == "plane":
        return None
    if level == "rest":
        width = max(1, round(REST_BORDER_SHARE * min(shape)))
        border = np.ones(shape, bool)
        border[width:-width, width:-width] = False
        return border
    mask = read_image(Path(level))
    marked: NDArray[np.bool_] = (mask if mask.ndim == 2 else mask.max(axis=2)) > 0
    marked = marked[::cell, ::cell]
    if marked.shape != shape:
        raise InputError(
            f"{level}: is {mask.shape[1]} x {mask.shape[0]} px, the height "
            f"{cell * shape[1]} x {cell * shape[0]}"
        )
    if marked.sum() < 3 or not np.ptp(np.nonzero(marked), axis=1).all():
        raise InputError(f"{level}: marks fewer than three pixels as level, or a line")
    return marked


def plane_terms(rows: int, columns: int) -> tuple[F8, F8, F8]:
    """1, x and y of a plane, as they broadcast to H x W."""
    x, y = ((np.arange(n) - n / 2) / n for n in (columns, rows))
    return np.ones((1, 1)), x[None], y[:, None]


def plane_weights(terms: F8, z: F8, least: float = MIN_SPREAD) -> F8:
    """Weights of N heights, or N x C values, for the planes that most agree on; terms N x 3.

    Residuals count as if their median were no smaller than half of `least`.
    """
    weights = np.ones(len(terms))
    plane = weighted_plane(terms, z, weights)
    for _ in range(FIT_ROUNDS):
        rest = np.linalg.norm((z - terms @ plane).reshape(len(terms), -1), axis=1)
        weights = 1 / (1 + (rest / max(ROBUST_WIDTH * float(np.median(rest)), least)) ** 2)
        before, plane = plane, weighted_plane(terms, z, weights)
        if np.abs(plane - before).max() < MIN_SPREAD:
            break
    return weights


def weighted_plane(terms: F8, z: F8, weights: F8) -> F8:
    """The plane of weighted least squares, 3; or 3 x C, of N x C values."""
    weighted = terms * weights[:, None]
    return np.asarray(np.linalg.pinv(weighted.T @ terms) @ (weighted.T @ z), np.float64)
