"""Remove the labels of single pixels that disagree with their neighbours."""

import cv2
import numpy as np

from tactograph.graph import node
from tactograph.nodes import Labels

LABEL_BITS = 8


@node(neutral="shadow")
def majority_labels(shadow: Labels) -> Labels:
    """Return for every LED the majority label of 3 x 3 pixels.

    Otherwise `shadow_constraints` would take a single lit pixel inside a shadow for the edge that
    casts it.

    Parameters
    ----------
    shadow : H x W; beyond the frame the border repeats
    """
    out = np.zeros_like(shadow)
    for bit in range(LABEL_BITS):
        plane = np.ascontiguousarray(shadow >> bit & 1)
        if plane.any():
            out |= np.asarray(cv2.medianBlur(plane, 3), np.uint8) << bit
    return out


majority_labels.opencl(grid="H W", lanes="rows")
