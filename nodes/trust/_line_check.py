"""Check whether an image is put together of rows that do not belong together."""

import numpy as np

from tactograph.nodes.trust._check import Check
from tactograph.nodes.trust.line_changes import LineChanges

MAX_ROW_CHANGE = 1.8
"""Change across a row over that along it that right touches stay below, where columns change
alike: edges along rows that lie under a film, and compressed images, which have lines both ways."""
MIN_CHANGE = np.float32(1e-4)
"""Change of the light that is divided by."""


def check_lines(lines: LineChanges) -> Check:
    """Return how far the worst row departs from the rows beside it (T5)."""
    across, along, columns = lines
    worst = float((across / np.maximum(along, MIN_CHANGE)).max())
    edges = float(columns.max() / max(np.median(columns), MIN_CHANGE))
    return Check(
        worst / max(edges, 1.0) / MAX_ROW_CHANGE,
        "rows of the image differ from those beside them as no surface does (check that frames are "
        "whole and not interlaced, and that no row is dead)",
    )
