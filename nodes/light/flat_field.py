"""Divide every image by the untouched film under the same LED."""

from typing import Annotated

import numpy as np
from annotated_types import Gt

from tactograph.graph import node
from tactograph.nodes import Dark, Light
from tactograph.nodes.light.film_drift import Drift, drift_gain
from tactograph.nodes.optics.rest_shape import MIN_REST_LIGHT


@node(neutral="image")
def flat_field(
    image: Light,
    flat: Light,
    dark: Dark,
    drift: Drift | None = None,
    *,
    floor: Annotated[float, Gt(0)] = MIN_REST_LIGHT,
) -> Light:
    """Return the light relative to the film at rest: 1 where nothing touches.

    This removes each LED's uneven light, the lens's vignetting and the film's albedo, so that
    one look-up table is valid for all pixels (section 3 assumes a constant albedo).

    Parameters
    ----------
    image : K x H x W, as captured
    flat : K x H x W, the untouched film, dark level already subtracted
    dark : H x W, all LEDs off
    drift : K x 6, the drift of each LED's light since the flat frame (`film_drift`); None: no drift
    floor : lower bound on the divisor; darker pixels carry no information and would amplify noise
    """
    light = np.empty_like(image)
    gains = [None] * len(image) if drift is None else drift_gain(drift, dark.shape)
    for captured, rest, gain, relative in zip(image, flat, gains, light, strict=True):
        level = np.maximum(rest, np.float32(floor))
        if gain is not None:
            level *= gain
        np.subtract(captured, dark, out=relative)
        relative /= level
    return light


flat_field.opencl(grid="H W", lanes="grid", integers="image")
