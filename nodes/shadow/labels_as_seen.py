"""Bring labels from the ideal grid back to the pixels of the camera."""

from __future__ import annotations

import numpy as np

from tactograph.graph import Flips, node
from tactograph.nodes import Labels, Lens
from tactograph.nodes.light._lens import ideal_places


@node(
    neutral="labels",
    tolerance=Flips(1e-3, why="places that lie between two pixels, rounded"),
)
def labels_as_seen(labels: Labels, lens: Lens) -> Labels:
    """Return the labels that each pixel of the camera sees: those of the nearest ideal pixel.

    Pixels that look beyond the ideal grid repeat its border.  Without a lens the labels are
    returned as they are.

    Parameters
    ----------
    labels
        H x W, a bit per LED, on the ideal grid.
    lens
        Length 8, as `read_lens` gives it (equations L1 and L2 of `_lens`).
    """
    if not lens.any():
        return labels
    rows, columns = labels.shape
    x, y = ideal_places(lens, labels.shape)
    column = np.clip(x, np.float32(0), np.float32(columns - 1)) + np.float32(0.5)
    row = np.clip(y, np.float32(0), np.float32(rows - 1)) + np.float32(0.5)
    return labels[row.astype(np.int32), column.astype(np.int32)]


labels_as_seen.opencl(grid="H W", row_lanes=True)
