"""Label the LEDs that reach each pixel, by brightness alone."""

from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval

from tactograph.graph import SizeLimit, node
from tactograph.nodes import Labels, Light


@node(sizes={"K": SizeLimit(1, 8, "a label holds a bit for each of at most 8 LEDs")})
def label_lit(
    light: Light,
    *,
    black: Annotated[float, Interval(ge=0, le=1)] = 0.01,
    which: Literal["lit", "dark"] = "lit",
) -> Labels:
    """Set bit k-1 where LED k gives more light than `black`, or where it does not.

    On a known convex object every darker pixel is in attached shadow.  Such pixels have to be
    excluded from the fits: a null vector (equation 11) fitted to black pixels detects nothing.
    With three LEDs the shadow test of equation 11 does not exist, so darkness is the only sign of
    a shadow.

    Parameters
    ----------
    light : K x H x W, 1 on the film at rest
    black : light up to which a pixel counts as not reached
    which : the LEDs to label: those that reach a pixel, or those that do not
    """
    bits = np.arange(light.shape[0], dtype=np.uint8)[:, None, None]
    lit = light > np.float32(black)
    chosen = (lit if which == "lit" else ~lit).astype(np.uint8)
    return np.asarray(np.bitwise_or.reduce(chosen << bits, axis=0), np.uint8)


label_lit.opencl(grid="H W")
