"""Look up the slope."""

from __future__ import annotations

import numpy as np

from tactograph.graph import node
from tactograph.nodes import Labels, Light, Slope
from tactograph.nodes.index_lut import LutIndex


@node
def lut_nearest(light: Light, shadow: Labels, index: LutIndex) -> Slope:
    """Nearest."""
    K, H, W = light.shape
    flat = light.reshape(K, -1)
    lab = shadow.ravel()
    out = np.zeros((2, H * W), np.float32)
    for t, (tree, off) in enumerate(index.trees):
        sel = np.nonzero(lab == (0 if t == 0 else 1 << (t - 1)))[0]
        if not len(sel):
            continue
        x = flat[:, sel].T.copy()
        if t:
            x[:, t - 1] = 0
        i = tree.query(x, workers=-1)[1]
        out[:, sel] = index.slopes[off + i].T
    return out.reshape(2, H, W)
