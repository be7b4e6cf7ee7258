"""Map the LEDs into the view of a camera near the film, for shadows in that view."""

import numpy as np

from tactograph.graph import node
from tactograph.nodes import LightPositions, Vergence

MIN_PUPIL_SHARE = np.float32(0.02)
"""Lower bound on the size of 1 - L_z / D: an LED at the pupil's height is far away, not at
infinity."""


@node
def lights_in_view(lights: LightPositions, camera: Vergence) -> LightPositions:
    """Return the LEDs under the projective map of `view_slope`: L / (1 - L_z / D).

    The map keeps lines straight (V3), so the seen height under these LEDs has the same shadows as
    the film under the real ones.  An LED higher than the pupil comes to lie below the film
    (L_z < 0).  Its light then arrives from the opposite direction.

    Parameters
    ----------
    lights : K x 3 in mm from the middle of the image
    camera : 1 / D in 1/mm; 0 returns the LEDs unchanged
    """
    share = 1 - np.float32(camera) * lights[:, 2:]
    share = np.copysign(np.maximum(np.abs(share), MIN_PUPIL_SHARE), share)
    return np.asarray(lights / share, np.float32)
