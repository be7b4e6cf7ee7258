"""Judge whether a light model is this sensor's, by the residual light and the film's brightness."""

from typing import Annotated

import numpy as np

from tactograph.graph import InputError, Port, node, warn
from tactograph.nodes import F4, Metrics

MAX_RESIDUAL = 0.01
"""Share of a cell's light that a model leaves at half of the cells; 0.005 on scans of two sensors
by their own models; 0.011 to 0.075 by others' models, by LEDs in another order, with one dimmed."""
REFUSED_RESIDUAL = 0.02
"""Share that refuses a model alone; a smaller one does where the brightness is wrong as well."""
BRIGHTNESS_RANGE = 0.75, 1.33
"""Range of the film's brightness, relative to when the model was made."""


@node
def judge_light_model(
    brightness: Annotated[F4, Port("H W", "1", high=2)],
    residual: Annotated[F4, Port("H W", "1", high=0.1)],
    *,
    force: bool = False,
) -> Metrics:
    """Warn where the light contradicts the model, and refuse a model that is clearly another's.

    Parameters
    ----------
    brightness, residual
        H x W, as `light_model_slope` gives them for cells, whose noise is small.
    force
        Warn at most.

    Returns
    -------
    dict
        ``model_residual``, the median of the residual, as a share of the light's brightness, and
        ``model_brightness``, that of the brightness.

    Raises
    ------
    InputError
        If the residual is above `REFUSED_RESIDUAL`, or above `MAX_RESIDUAL` at a brightness out of
        its range, unless `force`.
    """
    bright = float(np.median(brightness))
    left = float(np.median(residual)) / max(bright, 1e-6)
    usual = BRIGHTNESS_RANGE[0] < bright < BRIGHTNESS_RANGE[1]
    if left > MAX_RESIDUAL:
        told = (
            f"the light model leaves {left:.1%} of the light unexplained at half of the surface: "
            "is it this sensor's, and are the images in the order of its LEDs?"
        )
        if not force and (left > REFUSED_RESIDUAL or not usual):
            raise InputError(f"{told} force=true goes on all the same")
        warn(told)
    elif not usual:
        warn(
            f"the film is {bright:.2g} times as bright as when the light model was made: is it "
            "this sensor's, with the same exposure?"
        )
    return {"model_residual": left, "model_brightness": bright}
