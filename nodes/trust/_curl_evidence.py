"""What the curl of a touch's slopes comes to."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes.trust._check import MIN_CELLS, quarter_of, thinned
from tactograph.nodes.trust.slope_curl import CoarseCurl

STEPS_PER_IMAGE, STEPS_PER_PART = 9, 3
"""Steps along a side of the image at which its parts begin, and how many a part is wide."""
MAX_PART_CURL = 2.0
"""Curl over its expected size beyond which a cell of a part curls."""


class CurlFigures(NamedTuple):
    """Curl over its expected size."""

    upper: float
    """Upper quartile."""
    worst: float
    """Largest share of cells that curl in a part of the image."""


def curl_evidence(curl: CoarseCurl) -> CurlFigures:
    """Return how much the slopes of a touch curl, in all and in the worst part (T2).

    They are the upper quartile of the curl where it is tested, over its expected size; and the
    largest share of cells beyond `MAX_PART_CURL` in a ninth of the image.
    """
    cells = thinned(curl)
    squares = cells[cells >= 0]
    tested, curled = _by_part(cells >= 0), _by_part(cells > MAX_PART_CURL**2)
    # Of few cells many may curl by chance.
    share = (curled / (tested + MIN_CELLS)).max(initial=0)
    return CurlFigures(np.sqrt(quarter_of(squares, 3)), share)


def _by_part(cells: NDArray[np.bool_]) -> NDArray[Any]:
    """The number of cells in each part of the image."""
    before = np.pad(cells.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    rows, columns = (
        np.arange(STEPS_PER_IMAGE + 1) * side // STEPS_PER_IMAGE for side in cells.shape
    )
    at, wide = before[np.ix_(rows, columns)], STEPS_PER_PART
    return at[wide:, wide:] - at[:-wide, wide:] - at[wide:, :-wide] + at[:-wide, :-wide]
