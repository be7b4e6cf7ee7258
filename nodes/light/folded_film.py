"""Decide whether film is folded too narrowly for the cells of a rough height."""

import math
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge

from tactograph.graph import node
from tactograph.nodes import Slope
from tactograph.nodes.light.film_bounce import DEFAULT_CELLS

MIN_SLOPE = np.float32(0.1)
"""Slope below which film is taken to be at rest."""
MIN_STEEP_CELLS = 20
"""Number of steeper cells below which there is no touch."""


class FoldWidths(NamedTuple):
    """Whether the light from film to film needs a finer height; at most one is true."""

    wide: bool
    narrow: bool


@node
def folded_film(
    slope: Slope,
    *,
    folded_ratio: Annotated[float, Ge(0)] = 0.16,
    narrow_ratio: Annotated[float, Ge(0)] = 0.5,
) -> FoldWidths:
    """Return whether film is folded, and how narrowly.

    Averaged over cells, the edges of a fold are too flat, and flat film throws too little light on
    itself.  So the squared second differences of the slopes are compared with the squared slopes of
    steep cells (equation B3): the ratio is 0.06 on a ball, 0.4 on a soft cat, and 1 on walls two
    cells wide.  From 0.17 on, a groove or a step may be 1 % too shallow without a finer height.

    Parameters
    ----------
    slope
        2 x H x W in mm per mm, on the cells of a rough pass.  If these are more cells than those of
        `film_bounce`, every n-th row and column is used.
    folded_ratio, narrow_ratio : ratios from which on film is folded, and narrowly folded
    """
    step = max(round(math.sqrt(slope[0].size / DEFAULT_CELLS)), 1)
    slope = slope[:, ::step, ::step]
    squared = np.square(slope).sum(axis=0)
    steep = squared > MIN_SLOPE * MIN_SLOPE
    if np.count_nonzero(steep) < MIN_STEEP_CELLS:
        return FoldWidths(False, False)
    across, down = (np.square(np.diff(slope, 2, axis)).sum(axis=0) for axis in (2, 1))
    bend = (across[steep[:, 1:-1]].sum() + down[steep[1:-1]].sum()) / squared[steep].sum()
    return FoldWidths(bool(folded_ratio <= bend < narrow_ratio), bool(bend >= narrow_ratio))
