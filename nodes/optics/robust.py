"""The deviation of residuals among which there are outliers."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import DEVIATIONS_PER_MAD


def robust_deviation(
    residual: NDArray[Any], axis: int | None = None, *, keepdims: bool = False
) -> Any:
    """Return the standard deviation of residuals about zero, from the median of their sizes."""
    return DEVIATIONS_PER_MAD * np.median(np.abs(residual), axis=axis, keepdims=keepdims)
