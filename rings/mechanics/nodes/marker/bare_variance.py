"""The variance of slopes on bare film and under markers."""

from typing import Annotated

import numpy as np
from annotated_types import Gt

from tactograph.sdk import F4, Mask, Port, node

SlopeVariance = Annotated[F4, Port("2 H W", "1"), "Variance of p and of q"]


@node
def bare_variance(
    bare: Mask, *, film: Annotated[float, Gt(0)] = 1e-3, marker: Annotated[float, Gt(0)] = 1.0
) -> SlopeVariance:
    """Return the variance of p and q: one on bare film, a much larger one under markers.

    For sensors that do not state how noisy a slope is; only the ratio matters.

    Parameters
    ----------
    bare : H x W, as `bare_film` gives it
    film, marker : the variances
    """
    variance = np.where(bare > 0, np.float32(film), np.float32(marker))
    return np.stack([variance, variance])


bare_variance.opencl(grid="H W")
