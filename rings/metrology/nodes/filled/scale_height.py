"""Scale a height by what a step of known height says."""

from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.sdk import F4, Height, Port, node

Scale = tuple[Annotated[float, Interval(gt=0, le=10)], Annotated[float, Interval(ge=0, le=10)]]
"""``step_scale`` and ``step_scale_error`` of `measure_step`: a factor, its standard uncertainty."""
StepScale = Annotated[F4, Port("2", "1", low=0.1, high=1)]
"""The same as a value of a graph."""


@node(neutral="height")
def scale_height(
    height: Height, step: StepScale | None = None, *, scale: Scale | None = None
) -> Height:
    """Return the height times the factor of a known step; without one as it is.

    Parameters
    ----------
    height : H x W in mm
    step, scale : factor and its standard uncertainty, as `measure_step` finds them on a known step
    """
    factor = scale if step is None else step
    return height if factor is None else np.asarray(height * np.float32(factor[0]), np.float32)
