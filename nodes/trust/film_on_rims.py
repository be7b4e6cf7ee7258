"""Where the height hangs on rims that light does not measure."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from tactograph.graph import Port, node
from tactograph.nodes import F4, U1, Height, Lens, Mask
from tactograph.nodes.optics.lens import is_straight, nearest_ideal
from tactograph.nodes.trust._rims import hangs_on_rims


@node
def film_on_rims(
    height: Height,
    rims: Mask,
    like: Annotated[F4, Port("K r c", "1")],
    lens: Lens | None = None,
) -> Annotated[U1, Port("r c", "flag", high=1)]:
    """Return 1 where the film is rim, or rims close it in, as the camera sees it; else 0.

    Their share of the touch is the figure ``rim_share`` of `judge_touch`.

    Parameters
    ----------
    height, rims
        H x W in mm, and where its rims are (`rim_cells`), on the cells of a rough pass.
    like
        K x r x c, an image at full resolution; only its size counts.
    lens
        Length 8, as `read_lens` gives it; without it the image is not distorted.
    """
    hanging = hangs_on_rims(height, rims).view(np.uint8)
    if not hanging.any():  # as of nearly all touches
        return np.zeros(like.shape[1:], np.uint8)
    if lens is not None and not is_straight(lens):  # whole cells: rims are no finer
        hanging = hanging[nearest_ideal(lens, hanging.shape)]
    rows, columns = (
        np.minimum(np.arange(size) // max(round(size / count), 1), count - 1)
        for size, count in zip(like.shape[1:], hanging.shape, strict=True)
    )
    return hanging[:, columns][rows]
