"""What the curl of a touch's slopes comes to."""

from itertools import pairwise

import numpy as np

from tactograph.nodes.trust.checked_cells import MIN_CELLS, thinned
from tactograph.nodes.trust.slope_curl import CoarseCurl

CURL_BANDS = 9
"""Bands of rows of a frame, which is read row by row, so that some may be of another image."""


def curl_evidence(curl: CoarseCurl) -> float:
    """Return how much the slopes of a touch curl, over what is expected, in some rows (T2).

    It is the greatest mean of a band of rows.
    """
    cells = thinned(curl)
    tested, curls = cells >= 0, np.sqrt(np.maximum(cells, 0))
    starts = np.arange(CURL_BANDS + 1) * len(cells) // CURL_BANDS
    bands = (np.s_[start:end] for start, end in pairwise(starts))
    # Of few cells many may curl by chance.
    return max(float(curls[b].sum() / (tested[b].sum() + MIN_CELLS)) for b in bands)
