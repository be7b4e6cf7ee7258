"""Turn and shift a height map until its level parts lie in the plane z = 0."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.sdk import F8, Height, ImageFile, InputError, node, warn

MAX_FITTED = 50_000
"""Pixels that the plane is fitted to; more add nothing."""
FIT_ROUNDS = 30
ROBUST_WIDTH = 2.0
"""Residual, over the median of all, from which a pixel counts less (Cauchy's weight)."""
MIN_SPREAD = 1e-6
"""Smallest residual in mm above which a pixel counts less, and smallest change of a plane."""
HELD_SHARE, MOST_SHARE = 1 / 4, 1 / 2
"""Share of the film that makes a plane one that may be level, and that makes it what most share."""
TRIAL_COUNT = 440
"""Planes through three pixels: all three lie on one that holds a quarter, but for one in 1000."""
MAX_SCORED = 2000
"""Pixels that a plane's share is counted on."""
MAX_GROWTH = 2**0.25
"""Growth of a plane's share when twice as far counts: none on a plane, a factor of sqrt(2) on film
that bends."""
QUARTILE_OF_NORMAL, INLIER_DEVIATIONS = 0.3186, 2.5
"""Quartile of a normal residual's size over its deviation; deviations within which it counts."""
REST_BORDER_SHARE = 0.02
"""Share of the shorter side that is at rest around the frame, where film at rest is named."""


class SharedPlane(NamedTuple):
    """The plane that most film shares: what lies on it, its share, and that of the next one."""

    on_it: NDArray[np.bool_]
    shares: tuple[float, float]


@node(neutral="height")
def level_plane(height: Height, *, level: str = "plane") -> Height:
    """Subtract a plane: where nothing is at rest, slopes tell neither the zero nor the tilt.

    Parameters
    ----------
    height : H x W in mm
    level
        ``plane``: the one that most of the film shares (`shared_plane`); where none is, that of
        least squares, reweighted by Cauchy's function.  ``rest``: the frame's border, if the film
        is at rest there.  Else an image of the same size, not 0 where the surface is level.

    Warns
    -----
    UserWarning
        Where two planes hold a quarter of the film each.

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
    plane = one, across[:, every], down[every]
    sampled = np.stack([np.broadcast_to(term, counts.shape)[counts] for term in plane], 1)
    z = height[every, every][counts].astype(float)
    if marked is None:
        shared = shared_plane(sampled, z, MIN_SPREAD)
        weights = plane_weights(sampled, z, shared=shared)
        one_share, other_share = shared.shares
        if min(one_share, other_share) > HELD_SHARE:
            warn(
                f"two planes hold {one_share:.0%} and {other_share:.0%} of the surface, and the "
                "first is taken for level: name what is level by `level`"
            )
    else:
        weights = np.ones_like(z)
    zero, right, below = weighted_plane(sampled, z, weights)
    levelled = height - (zero + right * across).astype(np.float32)
    levelled -= (below * down).astype(np.float32)
    return levelled


def level_part(level: str, shape: tuple[int, int], cell: int = 1) -> NDArray[np.bool_] | None:
    """The pixels that are named as level, or one pixel of every cell; None where none are named."""
    if level == "plane":
        return None
    if level == "rest":
        width = max(1, round(REST_BORDER_SHARE * min(shape)))
        border = np.ones(shape, bool)
        border[width:-width, width:-width] = False
        return border
    mask = ImageFile(Path(level)).read()
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


def plane_weights(
    terms: F8, z: F8, least: float = MIN_SPREAD, shared: SharedPlane | None = None
) -> F8:
    """Weights of N heights, or N x C values, for the planes that most agree on; terms N x 3.

    They are 1 and 0 where a plane holds most heights, or two of them nearly all.  Else residuals
    count as if their median were no smaller than half of `least`.
    """
    shared = shared or shared_plane(terms, z, least)
    one_share, other_share = shared.shares
    if one_share > MOST_SHARE or one_share + other_share > MOST_SHARE + HELD_SHARE:
        return shared.on_it.astype(np.float64)
    weights = np.ones(len(terms))
    plane = weighted_plane(terms, z, weights)
    for _ in range(FIT_ROUNDS):
        rest = np.linalg.norm((z - terms @ plane).reshape(len(terms), -1), axis=1)
        weights = 1 / (1 + (rest / max(ROBUST_WIDTH * float(np.median(rest)), least)) ** 2)
        before, plane = plane, weighted_plane(terms, z, weights)
        if np.abs(plane - before).max() < MIN_SPREAD:
            break
    return weights


def shared_plane(terms: F8, z: F8, least: float) -> SharedPlane:
    """Return which of N heights, or N x C values, lie on the plane that most of them share.

    Random sample consensus (Fischler and Bolles 1981).  How far a height may lie from its plane
    follows from the plane that a quarter of the film is nearest to (Rousseeuw's least quantile of
    squares), so that no scale is given.  Film that bends has no such plane: shares of 0.
    """
    rng, values = np.random.default_rng(0), z.reshape(len(z), -1)
    some = rng.choice(len(z), min(len(z), MAX_SCORED), replace=False)
    three = rng.integers(0, len(z), (TRIAL_COUNT, 3))
    corners = terms[three]
    three = three[np.abs(np.linalg.det(corners)) > MIN_SPREAD]
    if not len(three):
        return SharedPlane(np.ones(len(z), bool), (0.0, 0.0))
    planes = np.linalg.solve(terms[three], values[three])
    away = np.linalg.norm(values[some] - terms[some] @ planes, axis=2)
    quarter = np.partition(away, away.shape[1] // 4, axis=1)[:, away.shape[1] // 4]
    near = INLIER_DEVIATIONS * max(float(quarter.min()) / QUARTILE_OF_NORMAL, least)
    plane = planes[(away < near).sum(axis=1).argmax()]
    for _ in range(FIT_ROUNDS):
        on_it = np.linalg.norm(values - terms @ plane, axis=1) < near
        before, plane = plane, weighted_plane(terms, values, on_it.astype(np.float64))
        if np.abs(plane - before).max() < MIN_SPREAD:
            break
    rest = np.linalg.norm(values - terms @ plane, axis=1)
    if (rest < 2 * near).mean() > MAX_GROWTH * on_it.mean():
        return SharedPlane(on_it, (0.0, 0.0))
    other = ((away < near) & ~on_it[some]).mean(axis=1).max()
    return SharedPlane(on_it, (float(on_it.mean()), float(other)))


def weighted_plane(terms: F8, z: F8, weights: F8) -> F8:
    """The plane of weighted least squares, 3; or 3 x C, of N x C values."""
    weighted = terms * weights[:, None]
    return np.asarray(np.linalg.pinv(weighted.T @ terms) @ (weighted.T @ z), np.float64)
