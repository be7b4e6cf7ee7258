"""Whether a turn has changed a height: a repeated group goes on while it does."""

from typing import Annotated

import numpy as np
from annotated_types import Ge

from tactograph.graph import node
from tactograph.nodes import Height


@node
def moves_height(height: Height, before: Height, *, um: Annotated[float, Ge(0)]) -> bool:
    """Return whether a height differs from the one before by more than so much.

    It is decided on the host on every back end, from float64 sums of the same heights.

    Parameters
    ----------
    height, before : H x W in mm
    um : largest difference, as the root of its mean square over the image, of a height that rests
    """
    moved = np.asarray(height, np.float64) - before
    return bool(1e3 * np.sqrt(np.mean(np.square(moved))) > um)
