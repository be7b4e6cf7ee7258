"""Heights by weighted least squares of many slopes on one small grid, solved exactly."""

from collections.abc import Callable

import numpy as np

from tactograph.sdk import F4, F8

GROUND_STIFFNESS = 1e-9
"""Stiffness that holds all heights at zero, relative to the stiffest step."""


def weighted_heights(variance: F4, pixel: float) -> Callable[[F4], F8]:
    """Return what integrates slopes 2 x H x W, a step of height weighing one over its variance.

    The equations are those of `integrate_dct`, but slopes of large variance bend no others.  A
    sparse factor of the matrix serves all slopes; it takes 0.2 s for 20,000 heights.
    """
    # Imported here: a graph without a scan need not load it.
    from scipy.sparse import csr_matrix, diags, eye
    from scipy.sparse.linalg import splu

    shape = variance.shape[1:]
    number = np.arange(variance[0].size).reshape(shape)
    first = np.r_[number[:, :-1].ravel(), number[:-1].ravel()]
    second = np.r_[number[:, 1:].ravel(), number[1:].ravel()]
    steps = np.tile(np.arange(first.size), 2)
    ends = np.repeat([-1.0, 1.0], first.size)
    difference = csr_matrix((ends, (steps, np.r_[first, second])), (first.size, number.size))
    weight = 1 / _halfway(variance)
    weight /= weight.max(initial=GROUND_STIFFNESS)
    pull = difference.T @ diags(weight)
    matrix = (pull @ difference + GROUND_STIFFNESS * eye(number.size)).tocsc()
    factor = splu(matrix, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

    def integrate(slope: F4) -> F8:
        return np.asarray(factor.solve(pull @ (pixel * _halfway(slope))).reshape(shape), np.float64)

    return integrate


def _halfway(of_both: F4) -> F8:
    """Means of a pixel and the next, of p along the rows and then of q along the columns."""
    p, q = of_both.astype(np.float64)
    return np.r_[((p[:, :-1] + p[:, 1:]) / 2).ravel(), ((q[:-1] + q[1:]) / 2).ravel()]
