"""The rigid motion that takes one touched surface to another: Gauss-Newton on slopes and heights.

A rigid surface z(x, y) that moves by v = t + w x X changes its height at a fixed place by

    dz = v . m,    m = (-dz/dx, -dz/dy, 1)                                            (R1)

so the six columns of the Jacobian are the planes (m, X x m).  The residual is another plane, the
second surface pulled back onto the first, less the first.  Errors of integrated slopes are white in
the slopes, so what is squared are the differences between neighbours of residual minus Jacobian
(the normals), and with little weight the residual itself, for the shift along z.  Coarse to fine.

A motion is open where the residual surface, which is noise, would tell as much of it as the shape
does (R2): a ball turns unseen, a cylinder slides.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, null_space

from tactograph.graph import NodeCall
from tactograph.nodes import F4
from tactograph.nodes.motion._surface import (
    F8,
    Surface,
    carried,
    normals,
    places,
    pulled_back,
    small_motion,
    trimmed,
)
from tactograph.nodes.motion.motion_equations import (
    AT_ACROSS,
    AT_DOWN,
    AT_GRADIENT,
    AT_PAIRS,
    UPPER_HALF,
    motion_equations,
)

CAUCHY_VARIANCE_SHARE = 0.7965
"""Share of its variance that Gaussian noise has when weighted by its own deviation (Cauchy)."""
EVERY_SLOPE = 1e6
"""A deviation that no slope comes near."""
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
    """A level of the first surface; steps are in the units of `to_middle`."""

    surface: Surface
    x: F4
    y: F4
    steepness: F4
    """2 x H x W, -dz/dx and -dz/dy."""
    to_middle: F8


def _key(surface: Surface, to_middle: F8) -> _Key:
    x, y = places(surface)
    return _Key(surface, x, y, normals(surface.height, surface.side), to_middle)


def _to_middle(surface: Surface) -> F8:
    """6 x 6: to small motions in mm about the image's middle, from those about the contact's.

    A turn counts `TURN_COST` times what it moves the contact's edge.
    """
    x, y = (plane[surface.touched] for plane in places(surface))
    middle = np.eye(4)
    middle[:3, 3] = x.mean(), y.mean(), surface.height[surface.touched].mean()
    reach = np.hypot(x - x.mean(), y - y.mean()).max()
    return carried(middle) @ np.diag([1, 1, 1, *[1 / (TURN_COST * reach)] * 3])


class _Weights(NamedTuple):
    """What the sums of a step are weighted by."""

    level: float
    """Deviation beyond which a slope loses weight."""
    variance: float
    """Of the residual slopes."""
    of_height: float
    """Weight of a height against that of a slope."""


class _Seen(NamedTuple):
    """Differences between the first surface and the second, moved back."""

    overlap: NDArray[np.bool_]
    residual: F4
    blocks: F8
    """B x 36, by `motion_equations`."""
    weights: _Weights
    """By which they were summed."""

    @property
    def level(self) -> float:
        """Standard deviation of the residual slopes, from those that keep their weight."""
        weight, square = self.blocks[:, AT_PAIRS : AT_PAIRS + 2].sum(axis=0)
        seen_share = 1.0 if self.weights.level == EVERY_SLOPE else CAUCHY_VARIANCE_SHARE
        return float(np.sqrt(square / (seen_share * weight))) + 1e-9

    def equations(self, key: _Key) -> tuple[F8, F8]:
        """A and g of the normal equations A d = g."""
        matrix, gradient = _unpacked(self.blocks.sum(axis=0), key.to_middle)
        return matrix / self.weights.variance, gradient / self.weights.variance


def _weights(seen: _Seen, first: Surface, now: Surface) -> _Weights:
    if first.variance is None or now.variance is None:
        variance = SLOPE_VARIANCE_RATIO * seen.level**2
    else:
        variance = first.variance + now.variance
    return _Weights(seen.level, variance, variance / (np.count_nonzero(seen.overlap) * ZERO_MM**2))


def _unpacked(sums: F8, to_middle: F8) -> tuple[F8, F8]:
    """A and g from their sums, in the units of `to_middle`."""
    matrix = np.zeros((6, 6))
    matrix[UPPER_HALF] = sums[:AT_GRADIENT]
    matrix = matrix + np.triu(matrix, 1).T
    return to_middle.T @ matrix @ to_middle, to_middle.T @ sums[AT_GRADIENT:AT_PAIRS]


def _see(
    key: _Key, now: Surface, motion: F8, weights: _Weights, equations: NodeCall
) -> _Seen | None:
    first = key.surface
    residual, touched = pulled_back(now, motion, key.x, key.y, first.height, key.steepness)
    touched &= first.touched
    blocks = _blocks(key, key.steepness, residual, touched, 1.0, weights, equations)
    if blocks[:, [AT_ACROSS, AT_DOWN]].sum() < MIN_PAIRS:
        return None
    return _Seen(touched, residual, blocks, weights)


def _blocks(
    key: _Key,
    steepness: F4,
    residual: F4,
    seen: NDArray[np.bool_],
    up: float,
    weights: _Weights,
    equations: NodeCall,
) -> F8:
    """The sums of `motion_equations`, B x 36."""
    first = key.surface
    terms = np.array(
        [first.side, first.left, first.top, up, weights.level, weights.of_height], np.float32
    )
    made = equations(first.height, steepness, residual, seen.view(np.uint8), terms)
    return np.asarray(made.reshape(-1, made.shape[-1]), np.float64)


def fit_motion(
    first: list[Surface],
    second: list[Surface],
    guess: F8,
    equations: NodeCall = motion_equations,
) -> Fit | None:
    """Find the rigid motion that takes the first surface to the second.

    Parameters
    ----------
    first, second
        Pyramids of the same sizes.
    guess
        4 x 4; an open motion stays as in the guess.
    equations
        `motion_equations`, on a device or not.

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
    fit = _fitted(keys[-1:], second[-1:], guess, equations)
    if fit is not None and (fit.likeness > SURE_LIKENESS or _is_noise(fit, first[-1], second[-1])):
        return fit
    other = _fitted(keys, second, guess, equations)
    return max((f for f in (fit, other) if f), key=lambda f: f.likeness, default=None)


def _is_noise(fit: Fit, first: Surface, second: Surface) -> bool:
    """Return whether the residual is no larger than the stated errors of both surfaces."""
    if first.variance is None or second.variance is None:
        return False
    return SLOPE_VARIANCE_RATIO * fit.misfit**2 < 2 * (first.variance + second.variance)


def _fitted(keys: list[_Key], second: list[Surface], guess: F8, equations: NodeCall) -> Fit | None:
    """The motion, coarse to fine; once more without those that turn out open."""
    descent = _descend(keys, second, guess, np.zeros((6, 0)), equations)
    told = _told(keys[-1], descent[1], equations) if descent else None
    if told and told.open.shape[1]:
        descent = _descend(keys, second, guess, told.open, equations)
        told = _told(keys[-1], descent[1], equations) if descent else None
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
        _likeness(seen),
    )


def _descend(
    keys: list[_Key], second: list[Surface], motion: F8, still: F8, equations: NodeCall
) -> tuple[F8, _Seen] | None:
    """Gauss-Newton, coarse to fine, without the motions `still`, 6 x k and orthonormal."""
    seen, free = None, null_space(still.T) if still.size else np.eye(6)
    for key, now in zip(keys, second, strict=True):
        # No residual is known yet: all slopes count alike, and no height.
        weights = _Weights(EVERY_SLOPE, 1.0, 0.0)
        for _ in range(MAX_STEPS):
            seen = _see(key, now, motion, weights, equations)
            if seen is None:
                break
            matrix, gradient = seen.equations(key)
            matrix += np.eye(6) / OPEN_MM**2
            step = free @ np.linalg.solve(free.T @ matrix @ free, free.T @ gradient)
            motion = motion @ small_motion(key.to_middle @ step)
            is_last = np.abs(step).max() < MIN_STEP_SHARE * key.surface.side
            if is_last and weights.of_height:
                break
            weights = _weights(seen, key.surface, now)
    return None if seen is None else (motion, seen)


class _Told(NamedTuple):
    covariance: F8
    open: F8
    """6 x k, orthonormal: motions that leave no trace."""


def _told(key: _Key, seen: _Seen, equations: NodeCall) -> _Told:
    """Covariance of the motions that the shape tells, and those that it leaves open (R2)."""
    matrix, _ = seen.equations(key)
    noise = _noise_information(key, seen, equations)
    shares, motions = eigh(noise, matrix + np.eye(6) / OPEN_MM**2)
    is_open = shares > OPEN_SHARE
    # What noise tells is in the matrix, but moves nothing.
    told = motions[:, ~is_open] / (1 - shares[~is_open])
    still = np.linalg.qr(motions[:, is_open])[0]
    moved = (np.eye(6) - still @ still.T) @ told
    return _Told(_scatter(key, seen, told) * moved @ moved.T + OPEN_MM**2 * still @ still.T, still)


def _noise_information(key: _Key, seen: _Seen, equations: NodeCall) -> F8:
    """The normal equations' matrix of a Jacobian that is noise alone.

    The residual holds the noise of two surfaces, the Jacobian that of one.
    """
    inner = cv2.erode(seen.overlap.view(np.uint8), np.ones((3, 3), np.uint8)) > 0
    noise, weights = normals(seen.residual, key.surface.side), seen.weights._replace(of_height=0.0)
    sums = _blocks(key, noise, seen.residual, inner, 0.0, weights, equations).sum(axis=0)
    share = sums[[AT_ACROSS, AT_DOWN]].sum() / seen.blocks[:, [AT_ACROSS, AT_DOWN]].sum()
    matrix, _ = _unpacked(sums, key.to_middle)
    return matrix / (2 * max(share, 1e-9) * weights.variance)


def _scatter(key: _Key, seen: _Seen, told: F8) -> float:
    """Observed over stated variance of the motions `told`, by the gradients of blocks; at least 1.

    What the film's model leaves is alike over many cells, and weighs more than the same noise.
    Half of a noise is curl, which integration has taken out.
    """
    gradients = seen.blocks[:, AT_GRADIENT:AT_PAIRS] @ key.to_middle @ told / seen.weights.variance
    return max(1.0, 2 * float(np.square(gradients).sum()) / max(told.shape[1], 1))


def _likeness(seen: _Seen) -> float:
    """Share of the variance of the first surface's slopes that the second one has, too."""
    sums = seen.blocks.sum(axis=0)
    pairs, rise, steep = (sums[[AT_ACROSS + i, AT_DOWN + i]] for i in range(3))
    pairs = np.maximum(pairs, 1)
    varied = float(np.sum(steep / pairs - (rise / pairs) ** 2))
    return 1 - 2 * float(sums[AT_PAIRS + 2] / pairs.sum()) / max(varied, 1e-12)
