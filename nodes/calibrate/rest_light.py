"""The light of the film at rest, also where nobody took a picture of it."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from tactograph.graph import Port, node
from tactograph.nodes import F4, Light, LightPositions, PixelSize
from tactograph.nodes.light._near_light import places


@node
def rest_light(
    flat: Light,
    lights: LightPositions,
    strength: Annotated[F4, Port("K", "1")],
    pixel: PixelSize,
) -> Light:
    """Return the flat frame; where it is uniform, because none was taken, a model of it.

    Under LED k at L the film at rest, P_0 = (x, y, 0), has the light
    ``strength_k (|L| / |L - P_0|)^3``: the fall-off is known, vignetting is not.

    Parameters
    ----------
    flat
        K x H x W, as `read_flat` gives it.
    lights, strength
        K x 3 in mm, and K, as `calibrate_lights` gives them.
    pixel
        mm per px.
    """
    if any(np.ptp(plane) > 0 for plane in flat):
        return flat
    x = places(flat.shape[2], np.float32(pixel))[None, :]
    y = places(flat.shape[1], np.float32(pixel))[:, None]
    model = []
    for (lx, ly, lz), level in zip(lights, strength, strict=True):
        farther = ((lx - x) ** 2 + (ly - y) ** 2 + lz * lz) / (lx * lx + ly * ly + lz * lz)
        model.append(level / (farther * np.sqrt(farther)))
    return np.asarray(np.stack(model), np.float32)
