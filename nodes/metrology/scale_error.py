"""Scale the stated error of a height as a step of known height scales the height."""

from __future__ import annotations

import numpy as np

from tactograph.graph import node
from tactograph.nodes import Height, HeightError
from tactograph.nodes.metrology.scale_height import Scale


@node(neutral="error")
def scale_error(error: HeightError, height: Height, *, scale: Scale | None = None) -> HeightError:
    """Return the error times the factor, with what the factor's own uncertainty adds.

    Parameters
    ----------
    error, height
        H x W in mm; the height after it was scaled.
    scale
        As for `scale_height`; None: the error as it is.
    """
    if scale is None:
        return error
    factor, uncertain = scale
    return np.asarray(np.hypot(error * factor, height / factor * uncertain), np.float32)
