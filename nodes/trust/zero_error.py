"""Error of the height's zero where no film is left at rest."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from tactograph.graph import Port, node
from tactograph.nodes import F4, CoarseLight, ZeroError
from tactograph.nodes.light.film_drift import Drift
from tactograph.nodes.trust._rest_check import MIN_CALM, find_rest


@node
def zero_error(
    light: CoarseLight,
    height: Annotated[F4, Port("r c", "mm", low=-1, high=5)],
    drift: Drift | None = None,
) -> ZeroError:
    """Return the standard deviation of the height's zero, the same for all pixels.

    Heights are above the film at rest.  A touch that reaches all borders leaves none of it, so
    that zero and tilt are guesses, as far off as the touch is high.

    Parameters
    ----------
    light
        K x h x w on cells, relative to the flat frame, before any drift is taken out.
    height
        r x c in mm.
    drift
        K x 6, as `film_drift` found it.

    Returns
    -------
    float
        In mm: the height's range where less than a fifth of the image is at rest, else 0.
    """
    if find_rest(light, drift).calm >= MIN_CALM:
        return 0.0
    return float(np.ptp(height))
