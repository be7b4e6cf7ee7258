"""The film that no marker covers."""

from typing import Annotated

import cv2
import numpy as np
from annotated_types import Interval

from tactograph.rings.mechanics.nodes.marker.marker_darkness import Darkness
from tactograph.sdk import Mask, node


@node
def bare_film(
    darkness: Darkness,
    *,
    dark: Annotated[float, Interval(ge=0.01, le=1)] = 0.06,
    grow_px: Annotated[int, Interval(ge=0, le=15)] = 1,
) -> Mask:
    """Return 1 where the film is bare, 0 on markers and around them.

    Parameters
    ----------
    darkness : H x W, as `marker_darkness` gives it
    dark : darkness above which a pixel belongs to a marker
    grow_px : pixels around a marker that count as part of it
    """
    covered = (darkness > np.float32(dark)).astype(np.uint8)
    side = 2 * grow_px + 1
    return np.asarray(1 - cv2.dilate(covered, np.ones((side, side), np.uint8)), np.uint8)


bare_film.opencl(grid="H W")
