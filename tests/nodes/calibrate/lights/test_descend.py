"""A descent ends at the least cost, and refuses a step that overflows."""

import warnings

import numpy as np
import pytest

from tactograph.nodes import F8
from tactograph.nodes.calibrate.lights.descend import least_squares


def test_a_step_that_overflows_is_refused_without_a_warning() -> None:
    """A first step that is much too long overflows, as the light of an LED in the film does."""

    def residual(unknown: F8) -> F8:
        return np.exp(10 * unknown) - np.exp(10.0)

    def slope(unknown: F8) -> F8:
        return np.diag(10 * np.exp(10 * unknown))

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        solution = least_squares(residual, np.array([0.0]), jacobian=slope)
    assert solution == pytest.approx(1, abs=1e-3)


def test_a_derivative_that_is_infinite_ends_the_descent_without_a_warning() -> None:
    """The light of an LED whose beam misses the film has such derivatives."""

    def slope(unknown: F8) -> F8:
        return np.diag(0.5 / np.sqrt(unknown))

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        solution = least_squares(lambda x: np.sqrt(x) - 1, np.array([0.0]), jacobian=slope)
    assert solution == 0
