"""Find film whose height depends on rims that light does not measure."""

from typing import Annotated, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.graph import Port, node
from tactograph.nodes import F4, U1, Height, Lens, Mask
from tactograph.nodes.optics.lens import is_straight, nearest_ideal

TOUCHED_SHARE = 0.1
"""Share of the greatest height above which film counts as touched."""
RimShare = Annotated[float, Port(unit="1")]
"""Share of the touched film whose height depends on rims."""


class FilmOnRims(NamedTuple):
    """Film whose height depends on rims, as the camera sees it, and its share of the touch."""

    film: Annotated[U1, Port("r c", "flag", high=1)]
    share: RimShare


@node
def film_on_rims(
    height: Height, rims: Mask, like: Annotated[F4, Port("K r c", "1")], lens: Lens | None = None
) -> FilmOnRims:
    """Return 1 where touched film is a rim, or enclosed by rims; else 0.

    Heights are sums of slopes.  A height is measured if a path leads down to the film at rest
    without crossing a rim.  Film that rims enclose is as high as they rise, and light does not show
    how high that is.

    Parameters
    ----------
    height, rims : H x W in mm, and its rims (`rim_cells`), on the cells of a rough pass
    like : K x r x c, an image at full resolution, which gives the size of the result
    lens : length 8, from `read_lens`; None: no distortion
    """
    nowhere = FilmOnRims(np.zeros(like.shape[1:], np.uint8), 0.0)
    if not rims.any():  # as in nearly all touches
        return nowhere
    touched = height > TOUCHED_SHARE * float(height.max())
    number, parts = cv2.connectedComponents(1 - rims, connectivity=4)
    measured = np.zeros(number, bool)
    measured[parts[~touched]] = True
    measured[0] = False  # part 0 is the rims
    hanging: NDArray[np.bool_] = touched & ~measured[parts]
    share = float(hanging.sum() / max(touched.sum(), 1))
    if not share:
        return nowhere
    if lens is not None and not is_straight(lens):  # to the nearest cell: rims are no finer
        hanging = hanging[nearest_ideal(lens, hanging.shape)]
    rows, columns = (
        np.minimum(np.arange(size) // max(round(size / count), 1), count - 1)
        for size, count in zip(like.shape[1:], hanging.shape, strict=True)
    )
    return FilmOnRims(hanging[:, columns][rows].view(np.uint8), share)
