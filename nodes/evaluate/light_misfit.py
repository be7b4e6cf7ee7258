"""Tell a touch whose light no surface explains."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Gt

from tactograph.graph import Port, node, warn
from tactograph.nodes import F4, Metrics

LARGEST = 1000.0
"""Of a pixel: specks of dirt, where the misfit is without bound, must not outweigh the film."""


@node
def light_misfit(
    misfit: Annotated[F4, Port("H W", "1", high=1e3)], *, most: Annotated[float, Gt(0)] = 20.0
) -> Metrics:
    """Return the mean misfit of the light; warn if no surface explains it.

    With more LEDs than a normal has unknowns, light of another sensor, or images in another
    order, fit no normal anywhere.  Over film at rest and touches on real and ray-traced sensors
    the mean is 0.2 to 5, and 12 on vertical walls under near LEDs.  Where two LEDs were swapped it
    is 19 to 600.

    Parameters
    ----------
    misfit
        H x W, as `label_lights` returns it: a sum of squares, in variances.
    most
        Mean from which there is a warning.

    Returns
    -------
    dict
        ``light_misfit``, the mean, no pixel above 1000.
    """
    mean = float(np.minimum(misfit, np.float32(LARGEST)).mean())
    if mean > most:
        warn(
            f"the light fits no surface under this calibration (misfit {mean:.0f}, below {most:g} "
            "is usual): check the order of the images, the calibration, and that the camera's "
            "gamma is off; the height may be wrong"
        )
    return {"light_misfit": mean}
