"""Exclude markers from the known pixels of a calibration's presses."""

import numpy as np

from tactograph.sdk import Mask, node


@node(neutral="mask")
def leave_out_markers(mask: Mask, bare: Mask) -> Mask:
    """Return the known pixels that show bare film.

    Parameters
    ----------
    mask : H x W, 1 where slope and height are known
    bare : H x W, 1 where no marker covers the film
    """
    return np.asarray(mask * (bare > 0), np.uint8)
