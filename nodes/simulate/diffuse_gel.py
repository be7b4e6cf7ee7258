"""Simulate a gel that diffuses part of the LEDs' light before it reaches the film."""

from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.graph import Close, node
from tactograph.nodes import Light


@node(neutral="light", tolerance=Close(1e-6, 1e-6, why="rounding of two products"))
def diffuse_gel(
    light: Light, rest: Light, *, share: Annotated[float, Interval(ge=0, le=1)] = 0.0
) -> Light:
    """Return light of which the gel diffuses a share, which does not depend on the film's slope.

    The light of the film, 1 at rest, becomes (1 - share) n.v + share, so that shadows are no
    longer black.  On a GelSight bench sensor the share is 0.36 to 0.42.

    Parameters
    ----------
    light : K x H x W, directly from the LEDs
    rest : K x H x W, the same for the film at rest
    share : share of the film's light at rest that the gel diffuses
    """
    return (np.float32(1) - np.float32(share)) * light + np.float32(share) * rest


diffuse_gel.opencl(grid="K H W", lanes="grid")
