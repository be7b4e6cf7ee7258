"""Robust least squares by the method of Levenberg and Marquardt, for every fit of a calibration."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np

from tactograph.nodes import F8
from tactograph.nodes.calibrate.rating.verdict import SURE_ODDS

HUBER_DEVIATIONS = 2.0
"""Residual in standard deviations beyond which a sample is an outlier."""
MAX_STEPS = 60
MIN_GAIN = 2 * math.log(SURE_ODDS)
"""Gain in squared standard deviations below which a descent ends: what it finds is no more surely
likelier."""
DERIVATIVE_STEP = float(np.sqrt(np.finfo(np.float32).eps))
"""Step of numeric derivatives, relative to an unknown's scale: the root of the rounding error."""
FIRST_DAMPING, MIN_DAMPING, MAX_DAMPING = 1e-3, 1e-9, 1e8

State = TypeVar("State")


def huber(residual: F8) -> float:
    """Return Huber's loss of residuals in standard deviations."""
    far, most = np.abs(residual), HUBER_DEVIATIONS
    return float(np.where(far < most, far * far, most * (2 * far - most)).sum())


def huber_weight(residual: F8) -> F8:
    """Return the weights of residuals in least squares that minimise Huber's loss."""
    return np.asarray(
        np.minimum(1, HUBER_DEVIATIONS / np.maximum(np.abs(residual), HUBER_DEVIATIONS))
    )


# A state whose light no number holds gains nothing, and is refused.
@np.errstate(over="ignore", divide="ignore", invalid="ignore")
def descend(
    now: State,
    cost: Callable[[State], float],
    linear: Callable[[State], Callable[[float], State]],
    renewed: Callable[[State], State] = lambda state: state,
) -> State:
    """Return the state of least cost near `now`.

    Parameters
    ----------
    cost : of a state, in squared standard deviations
    linear : the model about a state: the state after the step of a damping
    renewed : a state after a step, its standard deviations estimated anew
    """
    damping = FIRST_DAMPING
    for _ in range(MAX_STEPS):
        before, trial_at = cost(now), linear(now)
        while damping < MAX_DAMPING:
            trial = trial_at(damping)
            gain = before - cost(trial)
            if gain >= 0:
                break
            damping *= 10
        else:
            break
        now, damping = renewed(trial), max(damping / 10, MIN_DAMPING)
        if gain < MIN_GAIN:
            break
    return now


class NormalEquations(NamedTuple):
    """Normal equations of least squares, U x U, and their right-hand side, U."""

    normal: F8
    right: F8

    def step(self, damping: float) -> F8:
        """Return the unknowns' step, U; damping is relative to each one's own curvature."""
        scale, unit = self._unit()
        damped = unit + damping * np.eye(scale.size)
        return np.asarray(np.linalg.solve(damped, self.right / scale) / scale)

    def covariance(self) -> F8:
        """Return the covariance of the unknowns, U x U."""
        scale, unit = self._unit()
        return np.asarray(np.linalg.pinv(unit, hermitian=True) / np.outer(scale, scale))

    def _unit(self) -> tuple[F8, F8]:
        """The roots of the diagonal, and the equations over them."""
        scale = np.sqrt(np.maximum(np.diag(self.normal), 1e-30))
        return scale, self.normal / np.outer(scale, scale)


def least_squares(
    residual: Callable[[F8], F8],
    start: F8,
    scale: Any = 1.0,
    jacobian: Callable[[F8], F8] | None = None,
) -> F8:
    """Return the unknowns that minimise Huber's loss of the residual.

    Without a Jacobian, derivatives are by differences, by the unknowns' `scale` (`by_differences`).
    It solves the normal equations of twenty or thirty unknowns.  SciPy's least squares
    decomposes the whole Jacobian of ten thousand rows and more, and takes ten times as long.
    """

    def linear(unknown: F8) -> Callable[[float], F8]:
        residuals = residual(unknown)
        slopes = jacobian(unknown) if jacobian else by_differences(residual, unknown, scale)
        weight = huber_weight(residuals)
        normal = slopes.T @ (slopes * weight[:, None])
        equations = NormalEquations(normal, -(slopes.T @ (weight * residuals)))
        return lambda damping: unknown + equations.step(damping)

    return descend(start, lambda unknown: huber(residual(unknown)), linear)


def by_differences(function: Callable[[F8], F8], at: F8, scale: Any) -> F8:
    """Return the derivatives of a vector, N x U, by steps in single precision of the scales U."""
    before, steps = function(at), DERIVATIVE_STEP * scale * np.ones(at.size)
    return np.stack([(function(at + by) - before) / by.sum() for by in np.diag(steps)], axis=1)
