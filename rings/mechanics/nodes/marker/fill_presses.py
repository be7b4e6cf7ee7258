"""Fill the markers of every press."""

from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.rings.mechanics.nodes.marker.bare_film import bare_film
from tactograph.rings.mechanics.nodes.marker.fill_masked import fill_masked
from tactograph.rings.mechanics.nodes.marker.marker_darkness import marker_darkness
from tactograph.sdk import F4, Port, node

Presses = Annotated[F4, Port("P K H W", "1")]
"""P captures, each of K lights."""


@node(neutral="image")
def fill_presses(
    image: Presses,
    *,
    width_px: Annotated[int, Interval(ge=3, le=61)] = 11,
    grow_px: Annotated[int, Interval(ge=0, le=15)] = 1,
) -> Presses:
    """Return the presses with each marker replaced by a plane fitted to the light around it.

    Parameters
    ----------
    image : P x K x H x W
    width_px, grow_px : as for `marker_darkness` and `bare_film`
    """
    filled = []
    for press in image:
        bare = bare_film(marker_darkness(press, width_px=width_px), grow_px=grow_px)
        filled.append(fill_masked(press, bare))
    return np.stack(filled)
