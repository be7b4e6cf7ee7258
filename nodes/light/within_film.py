"""Make pixels that show no film, such as a housing, look like film at rest."""

from typing import Any

import numpy as np

from tactograph.graph import node
from tactograph.nodes import U1, Dark, Light, Mask


@node(neutral="image")
def within_film(image: Light, area: Mask, flat: Light, dark: Dark) -> Light:
    """Return the images, with the film at rest where the frame shows no film.

    Light relative to the film at rest is 1 there, so that no height arises.

    Parameters
    ----------
    image : K x H x W, as captured
    area : H x W, 1 where the frame shows film (`find_film`)
    flat, dark : K x H x W and H x W: the film at rest, dark level subtracted, and all LEDs off
    """
    if fills_frame(area):
        return image
    return np.where(area != 0, image, flat + dark)


within_film.opencl(grid="H W", lanes="grid", integers="image")


@within_film.idle
def fills_frame(area: U1) -> bool:
    """Return whether `area`, H x W, is film everywhere, so that nothing has to be filled."""
    return bool(area.all())


@within_film.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """A frame that mostly shows film."""
    area = (rng.random((H, W)) < 0.8).astype(np.uint8)
    area[0, 0] = 0
    return {"area": area}
