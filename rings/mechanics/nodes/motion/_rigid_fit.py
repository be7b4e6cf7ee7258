"""The rigid motion that takes one touched surface to another: Gauss-Newton on slopes and heights.

A rigid surface z(x, y) that moves by v = t + w x X changes its height at a fixed place by

    dz = v . m,    m = (-dz/dx, -dz/dy, 1)                                            (R1)

so the six columns of the Jacobian are the planes (m, X x m).  The residual is another plane, the
second surface pulled back onto the first, less the first.  Errors of integrated slopes are white in
the slopes, so what is squared are the differences between neighbours of residual minus Jacobian
(the normals), at a weight that falls for large ones (Cauchy); their mean tells the shift along z.
The Jacobian is the first surface's alone, so a step costs a product of matrices.

A motion below the noise is unobservable: the residual surface, which is noise, would determine it
as well as the shape does (R2).  A ball turns unseen, a cylinder slides.
"""

from collections.abc import Iterable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, null_space

from tactograph.rings.mechanics.nodes.motion._surface import (
    Surface,
    carried,
    normals,
    pulled_back,
    six_numbers,
    small_motion,
)
from tactograph.sdk import F4, F8

CAUCHY_SIGMAS = 2.4
"""Standard deviations beyond which a slope loses weight (Cauchy)."""
CAUCHY_VARIANCE_SHARE = 0.7965
"""Share of its variance that Gaussian noise has when weighted by its own deviation (Cauchy)."""
MAX_STEPS = 10
"""Most Gauss-Newton steps."""
MIN_STEP_VARIANCE = 0.5
"""Square of a step in its deviations; a shorter one is the last."""
SURE_LIKENESS, SURE_WAY_CELLS = 0.85, 4
"""Likeness of a sure fit, and how far at most from its guess: texture may fit elsewhere."""
JUMP_LIKENESS = 0.5
"""Likeness below which only the first guess leads anywhere."""
SURE_VARIANCES, SURE_OVERLAP = 4, 0.6
"""Variance of the residual slopes over the stated one below which a fit is sure at any distance,
and the overlap above which also without a texture in common."""
MIN_PAIRS = 30
OPEN_SHARE = 0.25
"""Share of the information on a motion above which noise alone gives it: the motion is open."""
OPEN_MM = 100.0
"""Standard deviation of an unobservable motion."""
TURN_COST = 30.0
"""Weight of a turn against a shift; among motions that differ by an open one the least is taken."""
ZERO_MM = 0.007
"""Standard deviation of a height's zero."""
SLOPE_VARIANCE_RATIO = 4.0
"""Variance of slopes over that of differences of heights that were integrated from them: the curl
is gone, and neighbours were averaged."""
HELD_BACK_SHARE, PRESSED_SHARE = 0.04, 0.4
"""Share of a tilt that the fit misses (standard deviation), since film that hangs over valleys
follows a tilt in part: the more, the less of the film curves down than the second share."""
RIM_RINGS = 16
"""Rings of cells along the contact's rim whose deviations are found apart."""
BLOCK_CELLS = 16
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
    likeness: float
    """Correlation of the slopes, their mean taken out."""
    sure: bool
    """Whether the surfaces differ by no more than their errors, or are alike near the guess."""


class _Key(NamedTuple):
    """The first surface; steps are in the units of `to_middle`."""

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
    ring: NDArray[np.intp]
    """H x W, how many cells it is to the contact's rim, at most `RIM_RINGS` - 1."""


def _key(surface: Surface, *, rings: bool) -> _Key | None:
    """Return None where too little is touched."""
    surface = surface.cropped()
    whole = surface.touched.view(np.uint8)
    touched = cv2.erode(whole, np.ones((3, 3), np.uint8), borderValue=0) > 0
    if np.count_nonzero(touched) < MIN_PAIRS:
        return None
    steepness = normals(surface.height, surface.side)
    z, steepness = (np.where(touched, p, np.float32(0)) for p in (surface.height, steepness))
    place = *surface.places(), z
    ring = np.zeros(touched.shape, np.intp)
    if rings:
        away = cv2.distanceTransform(touched.view(np.uint8), cv2.DIST_L2, 3)
        ring = np.minimum(away, RIM_RINGS - 1).astype(np.intp)
    to_middle = _to_middle(place, touched)
    jacobian = _jacobian(place, steepness, 1.0, to_middle)
    slopes = _slopes(jacobian, surface.side).reshape(6, -1)
    return _Key(surface, touched, place, steepness, to_middle, jacobian, slopes, ring)


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


class _Misfit(NamedTuple):
    """Differences between the first surface and the second, moved back."""

    overlap: NDArray[np.bool_]
    residual: F4
    slope: F4
    """Of the residual, 2 x H x W; 0 beside cells that are not seen."""
    weight: F4
    """2 x H x W, 1 / variance; less in rings that err more, and for large slopes."""
    levels: F8
    """Standard deviation of the residual slopes by ring, from those that keep their weight."""

    def equations(self, key: _Key) -> tuple[F8, F8]:
        """A and g of the normal equations A d = g."""
        weighted = self.weight.ravel() * key.slopes
        # The zero of a height is common to all cells.
        count = np.count_nonzero(self.overlap)
        mean = key.jacobian.reshape(6, -1) @ self.overlap.ravel().astype(np.float32) / count
        zero = self.residual[self.overlap].mean(dtype=np.float64) / ZERO_MM**2
        return (
            weighted @ key.slopes.T + np.outer(mean, mean) / ZERO_MM**2,
            weighted @ self.slope.ravel() + mean * zero,
        )


def _misfit(key: _Key, now: Surface, motion: F8, levels: F8 | None) -> _Misfit | None:
    """Compare; slopes far beyond the deviations `levels` of their rings lose weight."""
    residual = pulled_back(now, motion, *key.place, key.steepness)
    residual[~key.touched] = np.nan
    slope = _slopes(residual, now.side)
    pairs = np.isfinite(slope)
    pairs[0, :, -1] = pairs[1, -1] = False
    if np.count_nonzero(pairs) < MIN_PAIRS:
        return None
    slope[~pairs] = 0
    square, weight, share = slope**2, pairs.astype(np.float32), 1.0
    if levels is not None:
        far = (1 / (CAUCHY_SIGMAS * levels) ** 2).astype(np.float32)
        weight, share = weight / (1 + square * far[key.ring]), CAUCHY_VARIANCE_SHARE
    planes = (plane.sum(axis=0).ravel() for plane in (weight * square, share * weight))
    sums = np.array([np.bincount(key.ring.ravel(), plane, RIM_RINGS) for plane in planes])
    # Film that hangs beside the contact does not move with it.
    inward = sums[:, ::-1].cumsum(axis=1)[:, ::-1]
    rms = np.sqrt(np.max([s[0] / np.maximum(s[1], 1e-9) for s in (sums, inward)], axis=0)) + 1e-9
    stated = (key.surface.variance or 0.0) + (now.variance or 0.0)
    variance = np.maximum(stated, SLOPE_VARIANCE_RATIO * rms**2)
    least = sums[1].sum() / (sums[1] / variance).sum()
    # What it errs by is alike along a ring: no number of cells averages it.
    sure = (np.minimum(least / variance, 1) ** 2 / variance).astype(np.float32)
    return _Misfit(np.isfinite(residual), residual, slope, weight * sure[key.ring], rms)


def fit_motion(
    first: Surface,
    second: Surface,
    guesses: Iterable[F8],
    pressed: float = PRESSED_SHARE,
    *,
    rings: bool = True,
) -> Fit | None:
    """Find the rigid motion that takes the first surface to the second.

    Parameters
    ----------
    first, second : on cells of one size
    guesses
        4 x 4, the likeliest first: tried until one leads to a sure fit; else the most alike is
        taken, or the first where none is alike.  An unobservable motion stays as in the guess.
    pressed : share of the raised film that curves down (`held_film`)
    rings : whether rings along the contacts' rims count by what they err

    Returns
    -------
    Fit
        None where too little is touched in both.
    """
    key = _key(first, rings=rings)
    if key is None:
        return None
    best, least = None, -np.inf
    for guess in guesses:
        fit = _fitted(key, second, guess, pressed)
        if fit is not None and fit.sure:
            return fit
        if fit is not None and fit.likeness > least:
            best = fit
        least = max(best.likeness if best else least, JUMP_LIKENESS)
    return best


def _fitted(key: _Key, now: Surface, guess: F8, pressed: float) -> Fit | None:
    """The motion; found once more without those that turn out open."""
    still = np.zeros((6, 0))
    while True:
        descent = _descend(key, now, guess, still)
        if descent is None:
            return None
        motion, misfit = descent
        covariance, is_open = _observability(key, misfit)
        if still.size or not is_open.size:
            break
        still = is_open
    spread = carried(motion) @ key.to_middle
    overlap = float(np.count_nonzero(misfit.overlap) / np.count_nonzero(key.touched))
    covariance = spread @ (covariance + _held_back(key, motion, pressed)) @ spread.T
    likeness = _likeness(key, misfit)
    alike = likeness > SURE_LIKENESS
    sure = (alike and _is_near(key, motion, guess)) or (
        (alike or overlap > SURE_OVERLAP) and _is_noise(key, now, misfit)
    )
    return Fit(motion, covariance, is_open, overlap, likeness, sure)


def _is_noise(key: _Key, now: Surface, misfit: _Misfit) -> bool:
    """Return whether the residual is about as large as the stated errors of both surfaces."""
    if key.surface.variance is None or now.variance is None:
        return False
    stated = key.surface.variance + now.variance
    level = float(np.median(misfit.levels[key.ring[misfit.overlap]]))
    return SLOPE_VARIANCE_RATIO * level**2 < SURE_VARIANCES * stated


def _is_near(key: _Key, motion: F8, guess: F8) -> bool:
    """Return whether the contact has moved by few cells in the film's plane."""
    x, y, *_, turn = np.linalg.solve(key.to_middle, six_numbers(np.linalg.inv(guess) @ motion))
    return bool(np.hypot(x, y) + abs(turn) / TURN_COST < SURE_WAY_CELLS * key.surface.side)


def _held_back(key: _Key, motion: F8, pressed: float) -> F8:
    """Covariance of what hanging film holds back of a tilt about the contact's middle."""
    lean = np.zeros(6)
    share = HELD_BACK_SHARE * max(1.0, PRESSED_SHARE / max(pressed, HELD_BACK_SHARE))
    lean[3:5] = share * six_numbers(motion)[3:5] / key.to_middle[3, 3]
    return np.outer(lean, lean)


def _descend(key: _Key, now: Surface, motion: F8, still: F8) -> tuple[F8, _Misfit] | None:
    """Gauss-Newton without the motions `still`, 6 x k and orthonormal."""
    misfit, free = None, null_space(still.T) if still.size else np.eye(6)
    # No residual is known yet: all slopes count alike.
    deviations = None
    for _ in range(MAX_STEPS):
        misfit = _misfit(key, now, motion, deviations)
        if misfit is None:
            return None
        matrix, gradient = misfit.equations(key)
        matrix += np.eye(6) / OPEN_MM**2
        step = free @ np.linalg.solve(free.T @ matrix @ free, free.T @ gradient)
        motion = motion @ small_motion(key.to_middle @ step)
        if deviations is not None and step @ gradient < MIN_STEP_VARIANCE:
            break
        deviations = misfit.levels
    return None if misfit is None else (motion, misfit)


def _observability(key: _Key, misfit: _Misfit) -> tuple[F8, F8]:
    """Covariance of the motions that the shape tells, and those that it leaves open (R2)."""
    matrix, _ = misfit.equations(key)
    shares, motions = eigh(_noise_information(key, misfit), matrix + np.eye(6) / OPEN_MM**2)
    is_open = shares > OPEN_SHARE
    # What noise tells is in the matrix, but moves nothing.
    axes = motions[:, ~is_open] / (1 - shares[~is_open])
    still = np.linalg.qr(motions[:, is_open])[0]
    moved = (np.eye(6) - still @ still.T) @ axes
    return moved @ _scatter(key, misfit, axes) @ moved.T + OPEN_MM**2 * still @ still.T, still


def _noise_information(key: _Key, misfit: _Misfit) -> F8:
    """The normal equations' matrix of a Jacobian that is noise alone.

    The residual holds the noise of two surfaces, the Jacobian that of one.
    """
    side = key.surface.side
    noise = _jacobian(key.place, normals(misfit.residual, side), 0.0, key.to_middle)
    slopes = _slopes(noise, side).reshape(6, -1)
    counted = np.isfinite(slopes[0]) & (misfit.weight.ravel() > 0)
    share = np.count_nonzero(counted) / np.count_nonzero(misfit.weight)
    slopes = np.where(counted, slopes, 0)
    matrix = (misfit.weight.ravel() * slopes) @ slopes.T
    return np.asarray(matrix / (2 * max(share, 1e-9)), np.float64)


def _scatter(key: _Key, misfit: _Misfit, observable: F8) -> F8:
    """Covariance of `observable` motions in units of the stated one, by the gradients of blocks; at
    least 1 in any direction.

    What the film's model leaves is alike over many cells, and weighs more than the same noise.
    Half of a noise is curl, which integration has taken out.
    """
    each = (observable.T.astype(np.float32) @ key.slopes) * (misfit.weight * misfit.slope).ravel()
    blocks = each.reshape(-1, 2, *key.touched.shape).sum(axis=1)
    for axis, size in enumerate(key.touched.shape, start=1):
        blocks = np.add.reduceat(blocks, np.arange(0, size, BLOCK_CELLS), axis)
    blocks = blocks.reshape(len(blocks), -1).astype(np.float64)
    count = np.count_nonzero(blocks.any(axis=0))
    # The fit has made their sum zero.
    spread, axes = np.linalg.eigh(2 * blocks @ blocks.T * count / max(count - 1, 1))
    return np.asarray((axes * np.maximum(spread, 1)) @ axes.T)


def _likeness(key: _Key, misfit: _Misfit) -> float:
    """Share of the variance of the first surface's slopes that the second one has, too."""
    pairs = misfit.weight > 0
    rise = _slopes(key.place[2], key.surface.side)
    varied = sum(
        float(np.var(plane[mask])) for plane, mask in zip(rise, pairs, strict=True) if mask.any()
    )
    return 1 - 2 * float(np.mean(misfit.slope[pairs] ** 2)) / max(varied, 1e-12)
