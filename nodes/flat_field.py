"""Divide every image by the untouched film under the same LED."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Gt

from tactograph.graph import node
from tactograph.nodes import Dark, Light


@node(neutral="image")
def flat_field(
    image: Light,
    flat: Light,
    dark: Dark,
    *,
    floor: Annotated[float, Gt(0)] = 0.02,
) -> Light:
    """Return the light relative to the film at rest: 1 where nothing touches.

    Takes out each LED's uneven light, the lens's vignetting and the film's albedo, so that
    one look-up table holds for all pixels (section 3 assumes a constant albedo).

    Parameters
    ----------
    image
        K x H x W, as captured.
    flat
        K x H x W, the untouched film, dark level already taken off.
    dark
        H x W, all LEDs off.
    floor
        Smallest value of the flat image that is divided by; darker pixels carry no
        information and would only blow up noise.
    """
    light = np.empty_like(image)
    for captured, rest, found in zip(image, flat, light, strict=True):
        np.subtract(captured, dark, out=found)
        found /= np.maximum(rest, np.float32(floor))
    return light


flat_field.opencl(grid="H W", lanes=True)
