"""Decide whether a pass has moved the height, so that a repeated group goes on."""

from typing import Annotated

import numpy as np
from annotated_types import Ge

from tactograph.graph import node
from tactograph.nodes import Height


@node
def moves_height(height: Height, before: Height, *, settled_um: Annotated[float, Ge(0)]) -> bool:
    """Return whether the RMS difference of two heights exceeds a limit.

    The host decides, from float64 sums, so that all back ends decide alike.

    Parameters
    ----------
    height, before : H x W in mm, the height of this pass and of the previous one
    settled_um : largest RMS difference, in um, of a height that counts as settled
    """
    moved = np.asarray(height, np.float64) - before
    return bool(1e3 * np.sqrt(np.mean(np.square(moved))) > settled_um)
