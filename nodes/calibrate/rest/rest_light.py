"""Provide the light of the film at rest, by a model if no flat frame was taken."""

from typing import Annotated

import numpy as np

from tactograph.graph import Port, node
from tactograph.nodes import F4, Light, LightPositions, PixelSize
from tactograph.nodes.calibrate.lights.light_samples import is_uniform
from tactograph.nodes.optics.near_light import places


@node
def rest_light(
    flat: Light,
    lights: LightPositions,
    strength: Annotated[F4, Port("K", "1")],
    pixel: PixelSize,
) -> Light:
    """Return the flat frame, or a model of it if it is uniform because none was taken.

    Under LED k at L, the film at rest at P_0 = (x, y, 0) has the light
    ``strength_k (|L| / |L - P_0|)^3``.  This models the fall-off, but not vignetting.

    Parameters
    ----------
    flat : K x H x W, from `read_flat`
    lights, strength : K x 3 in mm, and K, from `calibrate_lights`
    pixel : mm per px
    """
    if not is_uniform(flat):
        return flat
    x = places(flat.shape[2], np.float32(pixel))[None, :]
    y = places(flat.shape[1], np.float32(pixel))[:, None]
    model = []
    for (lx, ly, lz), level in zip(lights, strength, strict=True):
        farther = ((lx - x) ** 2 + (ly - y) ** 2 + lz * lz) / (lx * lx + ly * ly + lz * lz)
        model.append(level / (farther * np.sqrt(farther)))
    return np.asarray(np.stack(model), np.float32)
