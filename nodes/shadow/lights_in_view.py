"""Map the LEDs into the view of a camera near the film, for shadows in that view."""

import numpy as np

from tactograph.graph import node
from tactograph.nodes import LightPositions, Vergence

MIN_PUPIL_SHARE = np.float32(0.02)
"""Lower bound on 1 - L_z / D, so that an LED at the pupil's height is far away, not at infinity."""


@node
def lights_in_view(lights: LightPositions, camera: Vergence) -> LightPositions:
    """Return the LEDs under the projective map of `view_slope`: L / (1 - L_z / D).

    The map keeps lines straight (V3), so the seen height under these LEDs has the same shadows as
    the film under the real ones.

    Parameters
    ----------
    lights : K x 3 in mm from the middle of the image
    camera : 1 / D in 1/mm; 0 returns the LEDs unchanged
    """
    share = np.maximum(1 - np.float32(camera) * lights[:, 2:], MIN_PUPIL_SHARE)
    return np.asarray(lights / share, np.float32)
