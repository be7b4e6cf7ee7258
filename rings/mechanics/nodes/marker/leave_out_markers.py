"""Exclude markers from the known pixels of a calibration's presses."""

import numpy as np

from tactograph.sdk import node
from tactograph.sdk.unstable import SheetMask


@node(neutral="mask")
def leave_out_markers(mask: SheetMask, bare: SheetMask) -> SheetMask:
    """Return the known pixels that show bare film.

    Parameters
    ----------
    mask : S x W, 1 where slope and height are known
    bare : S x W, 1 where no marker covers the film
    """
    return np.asarray(mask * (bare > 0), np.uint8)
