"""Remove the drift of the light from every press."""

from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.rings.oneshot.nodes.presses import PressImages
from tactograph.sdk import Light, Mask, node
from tactograph.sdk.nodes import coarsen, film_drift, flat_presses, level_light


@node(neutral="image")
def level_presses(
    image: PressImages,
    flat: Light,
    area: Mask | None = None,
    *,
    degree: Annotated[int, Interval(ge=0, le=2)] = 0,
) -> PressImages:
    """Divide each press by its drift, so that untouched film has the flat frame's light.

    A reflectance map must be fitted to presses levelled in the same way as its later inputs.

    Parameters
    ----------
    image, flat : P x K x H x W presses and the K x H x W film at rest
    area : H x W, 1 where the frame shows film; elsewhere the presses get the light of film at rest
    degree : as for `film_drift`
    """
    if area is not None:
        image = np.where(area != 0, image, flat)
    levelled = []
    for press in image:
        drift = film_drift(coarsen(flat_presses(press, flat)), degree=degree)
        levelled.append(level_light(press, drift))
    return np.stack(levelled)
