"""Which LEDs do not reach a pixel, told by darkness alone."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.graph import SizeLimit, node
from tactograph.nodes import Labels, Light


@node(neutral=0, sizes={"K": SizeLimit(1, 8, "a label holds a bit for each of at most 8 LEDs")})
def label_dark(light: Light, *, black: Annotated[float, Interval(ge=0, le=1)] = 0.1) -> Labels:
    """Set bit k-1 where LED k gives less light than `black`.

    Three lights leave no fourth against which a shadow could be tested (equation 11 needs
    one), so darkness is all there is to tell it by.

    Parameters
    ----------
    light
        K x H x W, 1 on the film at rest.
    black
        The light below which a pixel counts as not reached.
    """
    bits = np.arange(light.shape[0], dtype=np.uint8)[:, None, None]
    dark = (light < np.float32(black)).astype(np.uint8)
    return np.asarray(np.bitwise_or.reduce(dark << bits, axis=0), np.uint8)


label_dark.opencl(grid="H W")
