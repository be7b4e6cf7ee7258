"""The rigid motion that takes one touched surface to another: Gauss-Newton on slopes and heights.

A rigid surface z(x, y) that moves by v = t + w x X changes its height at a fixed place by

    dz = v . m,    m = (-dz/dx, -dz/dy, 1)                                            (M1)

so the six columns of the Jacobian are the planes (m, X x m).  The residual is another plane, the
second surface pulled back onto the first, less the first.  Errors of integrated slopes are white in
the slopes, so what is squared are the differences between neighbours of residual minus Jacobian
(the normals), and with little weight the residual itself, for the shift along z.  Coarse to fine.

A motion is open where the residual surface, which is noise, would tell as much of it as the shape
does (M2): a ball turns unseen, a cylinder slides.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, null_space

from tactograph.nodes import F4
from tactograph.nodes.contact.find_contact import MEDIAN_TO_DEVIATION
from tactograph.nodes.motion._surface import (
    F8,
    Surface,
    carried,
    columns_of,
    normals,
    places,
    pulled_back,
    small_motion,
    trimmed,
)

MAX_STEPS = 6
"""Most Gauss-Newton steps of a level."""
MIN_STEP_SHARE = 1e-2
"""Share of a cell's side: a shorter step ends a level."""
SURE_LIKENESS = 0.9
"""Likeness of a fit that needs no other."""
MIN_PAIRS = 30
OPEN_SHARE = 0.25
"""Share of the information on a motion above which noise alone gives it: the motion is open."""
OPEN_MM = 100.0
"""Standard deviation of an open motion."""
TURN_COST = 30.0
"""Weight of a turn against a shift; among motions that differ by an open one the least is taken."""
ZERO_MM = 0.01
"""Standard deviation of a height's zero."""
CAUCHY_SIGMAS = 2.4
"""Standard deviations beyond which a difference loses weight (Cauchy)."""
BLOCK_CELLS = 8
"""Cells of a side of the blocks whose gradients give the scatter."""
SLOPE_VARIANCE_RATIO = 4.0
"""Variance of slopes over that of differences of heights that were integrated from them: the curl
is gone, and neighbours were averaged."""


class Fit(NamedTuple):
    """A motion, 4 x 4 in mm, its error and quality."""

    motion: F8
    covariance: F8
    """6 x 6 of a small motion (mm, rad) after `motion`, about the image's middle."""
    open: F8
    """6 x k, orthonormal: the motions that leave no trace."""
    overlap: float
    """Share of the first surface's touched cells that the second has, too."""
    misfit: float
    """Standard deviation of the residual slopes."""
    likeness: float
    """Correlation of the slopes, their mean taken out."""


class _Key(NamedTuple):
    """A level of the first surface with its Jacobian, in the units of `to_middle`."""

    surface: Surface
    x: F4
    y: F4
    steepness: tuple[F4, F4]
    to_middle: F8
    pairs: NDArray[np.bool_]
    slopes: F4
    """6 x N, the Jacobian of the differences between touched neighbours."""
    heights: F4
    """6 x M, the Jacobian of the touched heights."""


def _key(surface: Surface, to_middle: F8) -> _Key:
    x, y = places(surface)
    steepness = normals(surface.height, surface.side)
    planes, pairs = columns_of(x, y, surface.height, steepness, 1.0), _pairs(surface.touched)
    slopes = np.stack([_slopes(plane, pairs, surface.side) for plane in planes])
    heights = np.stack([plane[surface.touched] for plane in planes])
    turned = to_middle.T.astype(np.float32)
    return _Key(surface, x, y, steepness, to_middle, pairs, turned @ slopes, turned @ heights)


def _to_middle(surface: Surface) -> F8:
    """6 x 6: to small motions in mm about the image's middle, from those about the contact's.

    A turn counts `TURN_COST` times what it moves the contact's edge.
    """
    x, y = (plane[surface.touched] for plane in places(surface))
    middle = np.eye(4)
    middle[:3, 3] = x.mean(), y.mean(), surface.height[surface.touched].mean()
    reach = np.hypot(x - x.mean(), y - y.mean()).max()
    return carried(middle) @ np.diag([1, 1, 1, *[1 / (TURN_COST * reach)] * 3])


class _Seen(NamedTuple):
    """Differences between the first surface and the second, moved back."""

    overlap: NDArray[np.bool_]
    residual: F4
    left: F4
    """N, slopes of the residual."""
    level: float
    """Their standard deviation."""
    weight: F4
    """N, 1 / variance; 0 where one surface is not touched."""

    def equations(self, key: _Key) -> tuple[F8, F8]:
        """A and g of the normal equations A d = g."""
        weighted = key.slopes * self.weight
        seen = self.overlap[key.surface.touched]
        flat = np.float32(1 / (np.count_nonzero(seen) * ZERO_MM**2)) * key.heights * seen
        matrix = weighted @ key.slopes.T + flat @ key.heights.T
        gradient = weighted @ self.left + flat @ self.residual[key.surface.touched]
        return matrix.astype(np.float64), gradient.astype(np.float64)


def _see(key: _Key, now: Surface, motion: F8) -> _Seen | None:
    first = key.surface
    residual, touched = pulled_back(now, motion, key.x, key.y, first.height, key.steepness)
    touched &= first.touched
    seen = _pairs(touched)[key.pairs]
    if np.count_nonzero(seen) < MIN_PAIRS:
        return None
    left = _slopes(residual, key.pairs, first.side)
    level = MEDIAN_TO_DEVIATION * float(np.median(np.abs(left[seen]))) + 1e-9
    weight = seen / (1 + (left / np.float32(CAUCHY_SIGMAS * level)) ** 2)
    if first.variance is None or now.variance is None:
        weight /= np.float32(SLOPE_VARIANCE_RATIO * level**2)
    else:
        weight /= np.float32(first.variance + now.variance)
    return _Seen(touched, residual, left, level, weight)


def _pairs(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """2 x H x W: whether a cell and its neighbour, right or below, are inside."""
    pairs = np.zeros((2, *inside.shape), bool)
    pairs[0, :, :-1] = inside[:, :-1] & inside[:, 1:]
    pairs[1, :-1] = inside[:-1] & inside[1:]
    return pairs


def _slopes(plane: F4, pairs: NDArray[np.bool_], side: float) -> F4:
    """Differences of the pairs over their distance, in order."""
    right, below = np.diff(plane, axis=1), np.diff(plane, axis=0)
    steps = np.concatenate([right[pairs[0, :, :-1]], below[pairs[1, :-1]]])
    return np.asarray(steps / np.float32(side))


def fit_motion(first: list[Surface], second: list[Surface], guess: F8) -> Fit | None:
    """Find the rigid motion that takes the first surface to the second.

    Parameters
    ----------
    first, second
        Pyramids of the same sizes.
    guess
        4 x 4; an open motion stays as in the guess.

    Returns
    -------
    Fit
        None where too little is touched in both.
    """
    inner = [trimmed(surface) for surface in first]
    if np.count_nonzero(inner[-1].touched) < MIN_PAIRS:
        return None
    to_middle = _to_middle(inner[-1])
    keys = [_key(surface, to_middle) for surface in inner]
    # A small motion needs no coarse cells, on which a fine texture may be taken for its repeat.
    fit = _fitted(keys[-1:], second[-1:], guess)
    if fit is not None and (fit.likeness > SURE_LIKENESS or _is_noise(fit, first[-1], second[-1])):
        return fit
    other = _fitted(keys, second, guess)
    return max((f for f in (fit, other) if f), key=lambda f: f.likeness, default=None)


def _is_noise(fit: Fit, first: Surface, second: Surface) -> bool:
    """Return whether the residual is no larger than the stated errors of both surfaces."""
    if first.variance is None or second.variance is None:
        return False
    return SLOPE_VARIANCE_RATIO * fit.misfit**2 < 2 * (first.variance + second.variance)


def _fitted(keys: list[_Key], second: list[Surface], guess: F8) -> Fit | None:
    """The motion, coarse to fine; once more without those that turn out open."""
    descent = _descend(keys, second, guess, np.zeros((6, 0)))
    told = _told(keys[-1], descent[1]) if descent else None
    if told and told.open.shape[1]:
        descent = _descend(keys, second, guess, told.open)
        told = _told(keys[-1], descent[1]) if descent else None
    if not (descent and told):
        return None
    motion, seen = descent
    spread = carried(motion) @ keys[-1].to_middle
    return Fit(
        motion,
        spread @ told.covariance @ spread.T,
        told.open,
        float(np.count_nonzero(seen.overlap) / np.count_nonzero(keys[-1].surface.touched)),
        seen.level,
        _likeness(keys[-1], seen),
    )


def _descend(
    keys: list[_Key], second: list[Surface], motion: F8, still: F8
) -> tuple[F8, _Seen] | None:
    """Gauss-Newton, coarse to fine, without the motions `still`, 6 x k and orthonormal."""
    seen, free = None, null_space(still.T) if still.size else np.eye(6)
    for key, now in zip(keys, second, strict=True):
        for _ in range(MAX_STEPS):
            seen = _see(key, now, motion)
            if seen is None:
                break
            matrix, gradient = seen.equations(key)
            matrix += np.eye(6) / OPEN_MM**2
            step = free @ np.linalg.solve(free.T @ matrix @ free, free.T @ gradient)
            motion = motion @ small_motion(key.to_middle @ step)
            if np.abs(step).max() < MIN_STEP_SHARE * key.surface.side:
                break
    return None if seen is None else (motion, seen)


class _Told(NamedTuple):
    covariance: F8
    open: F8
    """6 x k, orthonormal: motions that leave no trace."""


def _told(key: _Key, seen: _Seen) -> _Told:
    """Covariance of the motions that the shape tells, and those that it leaves open (M2)."""
    matrix, _ = seen.equations(key)
    shares, motions = eigh(_noise_information(key, seen), matrix + np.eye(6) / OPEN_MM**2)
    is_open = shares > OPEN_SHARE
    # What noise tells is in the matrix, but moves nothing.
    told = motions[:, ~is_open] / (1 - shares[~is_open])
    still = np.linalg.qr(motions[:, is_open])[0]
    moved = (np.eye(6) - still @ still.T) @ told
    return _Told(_scatter(key, seen, told) * moved @ moved.T + OPEN_MM**2 * still @ still.T, still)


def _noise_information(key: _Key, seen: _Seen) -> F8:
    """The normal equations' matrix of a Jacobian that is noise alone.

    The residual holds the noise of two surfaces, the Jacobian that of one.
    """
    surface = key.surface
    inner = cv2.erode(seen.overlap.view(np.uint8), np.ones((3, 3), np.uint8)) > 0
    kept = _pairs(inner)[key.pairs]
    if not kept.any():
        return np.zeros((6, 6))
    steepness = normals(seen.residual, surface.side)
    planes = columns_of(key.x, key.y, surface.height, steepness, 0.0)
    noise = np.stack([_slopes(plane, key.pairs, surface.side)[kept] for plane in planes])
    noise = key.to_middle.T.astype(np.float32) @ noise
    share = np.count_nonzero(kept) / np.count_nonzero(seen.weight)
    return np.asarray((noise * seen.weight[kept]) @ noise.T / (2 * share))


def _scatter(key: _Key, seen: _Seen, told: F8) -> float:
    """Observed over stated variance of the motions `told`, by the gradients of blocks; at least 1.

    What the film's model leaves is alike over many cells, and weighs more than the same noise.
    Half of a noise is curl, which integration has taken out.
    """
    down, right = (index // BLOCK_CELLS for index in np.nonzero(key.pairs)[1:])
    block = down * (seen.overlap.shape[1] // BLOCK_CELLS + 1) + right
    gradients = told.T.astype(np.float32) @ (key.slopes * (seen.weight * seen.left))
    sums = np.stack([np.bincount(block, row) for row in gradients])
    return max(1.0, 2 * float(np.square(sums).sum()) / max(told.shape[1], 1))


def _likeness(key: _Key, seen: _Seen) -> float:
    """Share of the variance of the first surface's slopes that the second one has, too."""
    kept, count = seen.weight > 0, np.count_nonzero(key.pairs[0])
    slopes = _slopes(key.surface.height, key.pairs, key.surface.side)
    varied = sum(
        part.var() for part in (slopes[:count][kept[:count]], slopes[count:][kept[count:]])
    )
    return 1 - 2 * float(np.square(seen.left[kept]).mean() / max(varied, 1e-12))
