"""The rigid motion that takes one touched surface to another: Gauss-Newton on slopes and heights.

A rigid surface z(x, y) that moves by v = t + w x X changes its height at a fixed place by

    dz = v . m,    m = (-dz/dx, -dz/dy, 1)                                            (R1)

so the six columns of the Jacobian are the planes (m, X x m).  The residual is another plane, the
second surface pulled back onto the first, less the first.  Errors of integrated slopes are white in
the slopes, so what is squared are the differences between neighbours of residual minus Jacobian
(the normals), at a weight that falls for large ones (Cauchy); their mean tells the shift along z.
The Jacobian is the first surface's alone, so a step costs a product of matrices.  Coarse to fine.

A motion is open where the residual surface, which is noise, would tell as much of it as the shape
does (R2): a ball turns unseen, a cylinder slides.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, null_space

from tactograph.nodes import F4, F8
from tactograph.nodes.motion._surface import Surface, carried, normals, pulled_back, small_motion

CAUCHY_SIGMAS = 2.4
"""Standard deviations beyond which a slope loses weight (Cauchy)."""
CAUCHY_VARIANCE_SHARE = 0.7965
"""Share of its variance that Gaussian noise has when weighted by its own deviation (Cauchy)."""
MAX_STEPS = 6
"""Most Gauss-Newton steps of a level."""
MIN_STEP_VARIANCE = 0.5
"""Square of a step in its deviations; a shorter one ends a level."""
SURE_LIKENESS = 0.9
"""Likeness of a fit that needs no other."""
COARSE_FACTORS = 4, 2
"""Sides of coarse cells in fine ones."""
MIN_PAIRS = 30
OPEN_SHARE = 0.25
"""Share of the information on a motion above which noise alone gives it: the motion is open."""
OPEN_MM = 100.0
"""Standard deviation of an open motion."""
TURN_COST = 30.0
"""Weight of a turn against a shift; among motions that differ by an open one the least is taken."""
ZERO_MM = 0.01
"""Standard deviation of a height's zero."""
SLOPE_VARIANCE_RATIO = 4.0
"""Variance of slopes over that of differences of heights that were integrated from them: the curl
is gone, and neighbours were averaged."""
BLOCK_CELLS = 8
"""Side of the blocks whose scatter is compared with the stated errors."""


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
    """A level of the first surface; steps are in the units of `to_middle`."""

    surface: Surface
    touched: NDArray[np.bool_]
    """Cells that have central differences."""
    place: tuple[F4, F4, F4]
    """x, y, z in mm, z zero where nothing is touched."""
    steepness: F4
    to_middle: F8
    jacobian: F4
    """6 x H x W."""
    slopes: F4
    """6 x (2 H W), of the Jacobian."""


def _key(surface: Surface, to_middle: F8 | None = None) -> _Key | None:
    """Return None where too little is touched."""
    surface = surface.cropped()
    whole = surface.touched.view(np.uint8)
    touched = cv2.erode(whole, np.ones((3, 3), np.uint8), borderValue=0) > 0
    if np.count_nonzero(touched) < MIN_PAIRS:
        return None
    steepness = normals(surface.height, surface.side)
    z, steepness = (np.where(touched, p, np.float32(0)) for p in (surface.height, steepness))
    place = *surface.places(), z
    if to_middle is None:
        to_middle = _to_middle(place, touched)
    jacobian = _jacobian(place, steepness, 1.0, to_middle)
    slopes = _slopes(jacobian, surface.side).reshape(6, -1)
    return _Key(surface, touched, place, steepness, to_middle, jacobian, slopes)


def _jacobian(place: tuple[F4, F4, F4], steepness: F4, up: float, to_middle: F8) -> F4:
    """Planes (m, X x m), R1; `up` is the third part of m, 0 for a surface of noise."""
    (x, y, z), (a, b), c = place, steepness, np.float32(up)
    planes = np.stack([a, b, np.full_like(a, c), y * c - z * b, z * a - x * c, x * b - y * a])
    return np.asarray(np.tensordot(to_middle.T.astype(np.float32), planes, 1))


def _slopes(planes: F4, side: float) -> F4:
    """Differences with the neighbours to the right and below, ... x 2 x H x W; 0 at the border."""
    out = np.zeros((*planes.shape[:-2], 2, *planes.shape[-2:]), np.float32)
    np.subtract(planes[..., 1:], planes[..., :-1], out=out[..., 0, :, :-1])
    np.subtract(planes[..., 1:, :], planes[..., :-1, :], out=out[..., 1, :-1, :])
    out *= np.float32(1 / side)
    return out


def _to_middle(place: tuple[F4, F4, F4], touched: NDArray[np.bool_]) -> F8:
    """6 x 6: to small motions in mm about the image's middle, from those about the contact's.

    A turn counts `TURN_COST` times what it moves the contact's edge.
    """
    x, y, z = (np.broadcast_to(plane, touched.shape)[touched] for plane in place)
    middle = np.eye(4)
    middle[:3, 3] = x.mean(), y.mean(), z.mean()
    reach = np.hypot(x - x.mean(), y - y.mean()).max()
    return carried(middle) @ np.diag([1, 1, 1, *[1 / (TURN_COST * reach)] * 3])


class _Seen(NamedTuple):
    """Differences between the first surface and the second, moved back."""

    overlap: NDArray[np.bool_]
    residual: F4
    slope: F4
    """Of the residual, 2 x H x W; 0 beside cells that are not seen."""
    weight: F4
    """2 x H x W."""
    level: float
    """Standard deviation of the residual slopes, from those that keep their weight."""
    variance: float
    """Of the residual slopes as they count: as stated, or as seen where that is larger."""

    def equations(self, key: _Key) -> tuple[F8, F8]:
        """A and g of the normal equations A d = g."""
        weighted = self.weight.ravel() * key.slopes
        # The zero of a height is common to all cells.
        count = np.count_nonzero(self.overlap)
        mean = key.jacobian.reshape(6, -1) @ self.overlap.ravel().astype(np.float32) / count
        zero = self.residual[self.overlap].mean(dtype=np.float64) / ZERO_MM**2
        matrix, gradient = weighted @ key.slopes.T, weighted @ self.slope.ravel()
        return (
            matrix / self.variance + np.outer(mean, mean) / ZERO_MM**2,
            gradient / self.variance + mean * zero,
        )


def _see(key: _Key, now: Surface, motion: F8, level: float | None) -> _Seen | None:
    """Compare; slopes far beyond the deviation `level` lose weight."""
    residual = pulled_back(now, motion, *key.place, key.steepness)
    residual[~key.touched] = np.nan
    slope = _slopes(residual, now.side)
    pairs = np.isfinite(slope)
    pairs[0, :, -1] = pairs[1, -1] = False
    count = np.count_nonzero(pairs)
    if count < MIN_PAIRS:
        return None
    slope[~pairs] = 0
    square = slope**2
    weight = pairs.astype(np.float32)
    if level is not None:
        weight /= 1 + square / np.float32(CAUCHY_SIGMAS * level) ** 2
    share = 1.0 if level is None else CAUCHY_VARIANCE_SHARE
    spread = np.vdot(weight, square) / (share * weight.sum(dtype=np.float64))
    found = float(np.sqrt(spread)) + 1e-9
    stated = (key.surface.variance or 0.0) + (now.variance or 0.0)
    variance = max(stated, SLOPE_VARIANCE_RATIO * found**2)
    return _Seen(np.isfinite(residual), residual, slope, weight, found, variance)


def fit_motion(
    first: Surface, second: Surface, guess: F8, factors: tuple[int, ...] = COARSE_FACTORS
) -> Fit | None:
    """Find the rigid motion that takes the first surface to the second.

    Parameters
    ----------
    first, second
        On cells of one size.
    guess
        4 x 4; an open motion stays as in the guess.
    factors
        Sides of the coarse cells that are tried where the fine ones do not fit.

    Returns
    -------
    Fit
        None where too little is touched in both.
    """
    key = _key(first)
    if key is None:
        return None
    fine = [(key, second)]
    # A small motion needs no coarse cells, on which a fine texture may be taken for its repeat.
    fit = _fitted(fine, guess)
    if fit is not None and (fit.likeness > SURE_LIKENESS or _is_noise(fit, first, second)):
        return fit
    coarse = ((_key(first.coarser(n), key.to_middle), second.coarser(n)) for n in factors)
    other = _fitted([(one, now) for one, now in coarse if one] + fine, guess)
    return max((f for f in (fit, other) if f), key=lambda f: f.likeness, default=None)


def _is_noise(fit: Fit, first: Surface, second: Surface) -> bool:
    """Return whether the residual is no larger than the stated errors of both surfaces."""
    if first.variance is None or second.variance is None:
        return False
    return SLOPE_VARIANCE_RATIO * fit.misfit**2 < 2 * (first.variance + second.variance)


def _fitted(levels: list[tuple[_Key, Surface]], guess: F8) -> Fit | None:
    """The motion, coarse to fine; once more without those that turn out open."""
    still, key = np.zeros((6, 0)), levels[-1][0]
    while True:
        descent = _descend(levels, guess, still)
        if descent is None:
            return None
        motion, seen = descent
        covariance, is_open = _told(key, seen)
        if still.size or not is_open.size:
            break
        still = is_open
    spread = carried(motion) @ key.to_middle
    overlap = np.count_nonzero(seen.overlap) / np.count_nonzero(key.touched)
    covariance = spread @ covariance @ spread.T
    return Fit(motion, covariance, is_open, overlap, seen.level, _likeness(key, seen))


def _descend(levels: list[tuple[_Key, Surface]], motion: F8, still: F8) -> tuple[F8, _Seen] | None:
    """Gauss-Newton, coarse to fine, without the motions `still`, 6 x k and orthonormal."""
    seen, free = None, null_space(still.T) if still.size else np.eye(6)
    for key, now in levels:
        # No residual is known yet: all slopes count alike.
        level = None
        for _ in range(MAX_STEPS):
            seen = _see(key, now, motion, level)
            if seen is None:
                break
            matrix, gradient = seen.equations(key)
            matrix += np.eye(6) / OPEN_MM**2
            step = free @ np.linalg.solve(free.T @ matrix @ free, free.T @ gradient)
            motion = motion @ small_motion(key.to_middle @ step)
            if level is not None and step @ gradient < MIN_STEP_VARIANCE:
                break
            level = seen.level
    return None if seen is None else (motion, seen)


def _told(key: _Key, seen: _Seen) -> tuple[F8, F8]:
    """Covariance of the motions that the shape tells, and those that it leaves open (R2)."""
    matrix, _ = seen.equations(key)
    shares, motions = eigh(_noise_information(key, seen), matrix + np.eye(6) / OPEN_MM**2)
    is_open = shares > OPEN_SHARE
    # What noise tells is in the matrix, but moves nothing.
    told = motions[:, ~is_open] / (1 - shares[~is_open])
    still = np.linalg.qr(motions[:, is_open])[0]
    moved = (np.eye(6) - still @ still.T) @ told
    return _scatter(key, seen, told) * moved @ moved.T + OPEN_MM**2 * still @ still.T, still


def _noise_information(key: _Key, seen: _Seen) -> F8:
    """The normal equations' matrix of a Jacobian that is noise alone.

    The residual holds the noise of two surfaces, the Jacobian that of one.
    """
    side = key.surface.side
    noise = _jacobian(key.place, normals(seen.residual, side), 0.0, key.to_middle)
    slopes = _slopes(noise, side).reshape(6, -1)
    known = np.isfinite(slopes[0]) & (seen.weight.ravel() > 0)
    share = np.count_nonzero(known) / np.count_nonzero(seen.weight)
    slopes = np.where(known, slopes, 0)
    matrix = (seen.weight.ravel() * slopes) @ slopes.T
    return np.asarray(matrix / (2 * max(share, 1e-9) * seen.variance), np.float64)


def _scatter(key: _Key, seen: _Seen, told: F8) -> float:
    """Observed over stated variance of the motions `told`, by the gradients of blocks; at least 1.

    What the film's model leaves is alike over many cells, and weighs more than the same noise.
    Half of a noise is curl, which integration has taken out.
    """
    rows, columns = key.surface.height.shape
    each = (told.T.astype(np.float32) @ key.slopes) * (seen.weight * seen.slope).ravel()
    planes = each.reshape(-1, 2, rows, columns).sum(axis=1)
    for axis, size in ((1, rows), (2, columns)):
        planes = np.add.reduceat(planes, np.arange(0, size, BLOCK_CELLS), axis)
    total = float(np.vdot(planes, planes)) / seen.variance**2
    return max(1.0, 2 * total / max(told.shape[1], 1))


def _likeness(key: _Key, seen: _Seen) -> float:
    """Share of the variance of the first surface's slopes that the second one has, too."""
    pairs = seen.weight > 0
    rise = _slopes(key.place[2], key.surface.side)
    varied = sum(
        float(np.var(plane[mask])) for plane, mask in zip(rise, pairs, strict=True) if mask.any()
    )
    return 1 - 2 * float(np.mean(seen.slope[pairs] ** 2)) / max(varied, 1e-12)
