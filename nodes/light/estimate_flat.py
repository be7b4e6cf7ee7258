"""Estimate a missing flat frame: the smooth part of the touch's images."""

from typing import Annotated, Any

import numpy as np
from annotated_types import Interval
from numpy.polynomial.chebyshev import chebvander2d
from numpy.typing import NDArray

from tactograph.graph import node
from tactograph.nodes import Light, robust_deviation
from tactograph.nodes.optics.smoothed_light import MAX_FIT_PIXELS

FIT_ROUNDS = 8
OUTLIER_SIGMAS = 2.5
"""Robust standard deviations of the residuals beyond which a pixel is not film at rest."""


@node
def estimate_flat(image: Light, *, degree: Annotated[int, Interval(ge=0, le=8)] = 3) -> Light:
    """Fit a smooth light to each image where the film is nearly level.

    This is for recordings without a flat frame.  A polynomial is fitted by least squares, outliers
    are excluded, and the fit is repeated; the remaining pixels are taken to be film at rest.  It
    works if most of the film is nearly level.  It cannot distinguish a tilt of the whole film from
    uneven light.

    Parameters
    ----------
    image : K x H x W
    degree : degree of the polynomial along x and along y

    Returns
    -------
    K x H x W, the light that the film at rest would give.
    """
    height, width = image.shape[1:]
    v = np.linspace(-1, 1, height)
    u = np.linspace(-1, 1, width)
    stride = max(1, int(np.sqrt(height * width / MAX_FIT_PIXELS)))
    sampled = chebvander2d(*np.meshgrid(u[::stride], v[::stride]), [degree, degree])
    basis = sampled.reshape(-1, (degree + 1) ** 2)
    across = np.polynomial.chebyshev.chebvander(u, degree)
    down = np.polynomial.chebyshev.chebvander(v, degree)
    planes = []
    for plane in image:
        coefficients = _robust(basis, plane[::stride, ::stride].ravel().astype(np.float64))
        planes.append(down @ coefficients.reshape(degree + 1, degree + 1).T @ across.T)
    return np.maximum(np.stack(planes), 1e-3).astype(np.float32)


def _robust(basis: NDArray[Any], values: NDArray[Any]) -> NDArray[Any]:
    """Fit by least squares, repeatedly, and exclude outliers each time."""
    inliers = np.ones(len(values), bool)
    for _ in range(FIT_ROUNDS):
        coefficients, *_ = np.linalg.lstsq(basis[inliers], values[inliers], rcond=None)
        residual = np.abs(values - basis @ coefficients)
        spread = robust_deviation(residual[inliers])
        inliers = residual <= max(OUTLIER_SIGMAS * spread, 1e-6)
    return np.asarray(coefficients)
