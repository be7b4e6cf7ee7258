"""Which LEDs reach each pixel of a calibration capture."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.graph import SizeLimit, node
from tactograph.nodes import Labels, Light


@node(sizes={"K": SizeLimit(1, 8, "a label holds a bit for each of at most 8 LEDs")})
def label_lit(light: Light, *, black: Annotated[float, Interval(ge=0, le=1)] = 0.01) -> Labels:
    """Set bit k-1 where LED k gives more light than `black`.

    On a known convex object any darker pixel is in attached shadow.  It must stay out of
    the fits: with black pixels in it the null vector of equation 11 detects nothing.

    Parameters
    ----------
    light
        K x H x W, 1 on the film at rest.
    black
        The light below which a pixel counts as not reached.
    """
    bits = np.arange(light.shape[0], dtype=np.uint8)[:, None, None]
    lit = (light > np.float32(black)).astype(np.uint8)
    return np.asarray(np.bitwise_or.reduce(lit << bits, axis=0), np.uint8)


label_lit.opencl(grid="H W")
