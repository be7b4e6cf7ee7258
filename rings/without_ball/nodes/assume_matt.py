"""Assume a matt film where nothing more is known about it."""

from typing import NamedTuple

import numpy as np

from tactograph.sdk import Film, LightPositions, Misfit, node
from tactograph.sdk.unstable import LightPlaces


class MattFilm(NamedTuple):
    """A film, and the misfit of a model that leaves only noise."""

    film: Film
    misfit: Misfit


@node
def assume_matt(lights: LightPositions, other_lights: LightPlaces) -> MattFilm:
    """Return the film of equation N1 (`optics/near_light`): matt, seen from far away.

    Parameters
    ----------
    lights, other_lights : K x 3 and 8 x K x 3 in mm, as `calibrate_lights` gives them
    """
    # Level and its width, light, light from film to film, and tilt: only noise remains.
    misfit = np.array([0, 1, 0, 0, 0], np.float32)
    return MattFilm(Film.matt(lights)._replace(other_lights=other_lights), misfit)
