"""What the film beside a touch looks like, against the flat frame."""

from typing import Annotated, NamedTuple

import numpy as np

from tactograph.graph import Port
from tactograph.nodes import F4, CoarseLight, Height
from tactograph.nodes.light.film_drift import CALM_DEPARTURES, Drift, border_level, drift_gain
from tactograph.nodes.trust.checked_cells import DARK_LIGHT, thinned

RestLevel = Annotated[F4, Port("K", "1", low=0.9, high=1.1)]
"""Each LED's light on the film at rest, relative to the flat frame."""


class FilmFigures(NamedTuple):
    """What the film at rest is like."""

    shape: float
    """Greatest change of an LED's light across the image."""
    calm: float
    """Share of the image at rest."""
    dark: float
    """Share of the image without any light, however dim the touch is as a whole."""
    lowest: float
    """Height in mm."""
    highest: float


def rest_evidence(
    light: CoarseLight, height: Height, drift: Drift | None = None
) -> tuple[RestLevel, FilmFigures]:
    """Return the light of the film at rest, how much of it there is, and the height's range (T3).

    Without a drift, or if none was found, the median of the frame's border is each LED's light.
    """
    cells, shape = thinned(light), 0.0
    if drift is not None and (drift[:, 0] != 1).any():
        level, shape = drift[:, 0], np.abs(drift[:, 1:]).max()
        even = cells / drift_gain(drift, cells.shape[1:])
    else:
        level = border_level(cells)
        even = cells / np.maximum(level, DARK_LIGHT)[:, None, None]
    dark = (even < DARK_LIGHT).all(axis=0).mean()
    calm = (np.abs(even - 1) < CALM_DEPARTURES[0]).all(axis=0).mean()
    return level, FilmFigures(shape, calm, dark, height.min(), height.max())
