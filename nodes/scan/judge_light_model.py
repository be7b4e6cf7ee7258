"""Judge whether a light model is this sensor's, by the residual light and the film's brightness."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from tactograph.graph import Port, node, warn
from tactograph.nodes import F4, Metrics

MAX_RESIDUAL = 0.02
"""Share of full scale that a model leaves of the light at half of the pixels; 0.006 and 0.014 on
scans of two sensors by their own models, 0.03 and 0.06 by those of others."""
BRIGHTNESS_RANGE = 0.75, 1.33
"""Range of the film's brightness, relative to when the model was made."""


@node
def judge_light_model(
    brightness: Annotated[F4, Port("H W", "1", high=2)],
    residual: Annotated[F4, Port("H W", "1", high=0.1)],
) -> Metrics:
    """Warn where the light contradicts the model.

    Parameters
    ----------
    brightness, residual
        H x W, as `light_model_slope` gives them.

    Returns
    -------
    dict
        ``model_residual``, the median of the residual, and ``model_brightness``, that of the
        brightness.
    """
    left, bright = float(np.median(residual)), float(np.median(brightness))
    if left > MAX_RESIDUAL:
        warn(
            f"the light model leaves {left:.1%} of full scale unexplained at half of the pixels: "
            "is it this sensor's, and are the images in the order of its LEDs?"
        )
    elif not BRIGHTNESS_RANGE[0] < bright < BRIGHTNESS_RANGE[1]:
        warn(
            f"the film is {bright:.2g} times as bright as when the light model was made: is it "
            "this sensor's, with the same exposure?"
        )
    return {"model_residual": left, "model_brightness": bright}
