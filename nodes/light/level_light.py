"""Remove the drift of the LEDs from the light."""

import numpy as np

from tactograph.graph import Close, SizeLimit, node
from tactograph.nodes import Light
from tactograph.nodes.light.film_drift import Drift, drift_gain


@node(
    neutral="light",
    tolerance=Close(1e-6, 1e-5, why="rounding of a polynomial and a division"),
    sizes={"K": SizeLimit(1, 8, "more LEDs than a label has bits")},
)
def level_light(light: Light, drift: Drift) -> Light:
    """Divide each LED's light by its drift, so that the film at rest is 1 again.

    Parameters
    ----------
    light : K x H x W, relative to the film at rest
    drift : K x 6, from `film_drift`
    """
    return np.asarray(light / drift_gain(drift, light.shape[1:]), np.float32)


level_light.opencl(grid="H W", lanes="grid")
