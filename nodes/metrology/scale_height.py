"""Scale a height by what a step of known height says."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Interval, Len

from tactograph.graph import node
from tactograph.nodes import Height

Scale = Annotated[tuple[Annotated[float, Interval(ge=0, le=10)], ...], Len(2, 2)]
"""``step_scale`` and ``step_scale_error`` of `measure_step`: a factor, its standard uncertainty."""


@node(neutral="height")
def scale_height(height: Height, *, scale: Scale | None = None) -> Height:
    """Return the height times the factor of a known step; None: as it is.

    Parameters
    ----------
    height
        H x W in mm.
    scale
        Factor and its standard uncertainty.
    """
    return height if scale is None else np.asarray(height * np.float32(scale[0]), np.float32)
