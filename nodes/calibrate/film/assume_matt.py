"""Assume a matt film where nothing more is known about it."""

from __future__ import annotations

from tactograph.graph import node
from tactograph.nodes import Film, LightPlaces, LightPositions
from tactograph.nodes.optics.film import matt_film


@node
def assume_matt(lights: LightPositions, others: LightPlaces) -> Film:
    """Return the film of equation N1 (`optics/near_light`): matt, seen from far away.

    Parameters
    ----------
    lights, others
        K x 3 and 8 x K x 3 in mm, as `calibrate_lights` gives them.
    """
    return matt_film(lights)._replace(others=others)
