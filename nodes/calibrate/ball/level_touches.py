"""Remove the drift of the light from every press on a sheet."""

import numpy as np

from tactograph.graph import node
from tactograph.nodes import Light, Noise
from tactograph.nodes.calibrate import DRIFT_DEGREE
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.light.film_drift import film_drift
from tactograph.nodes.light.level_light import level_light
from tactograph.nodes.light.light_noise import rest_noise
from tactograph.nodes.optics.sheet import SheetLight, cut


@node(neutral="light")
def level_touches(light: SheetLight, flat: Light, noise: Noise) -> SheetLight:
    """Divide each press by its drift, so that untouched film has the flat frame's light.

    Pressed film brightens the untouched film around it by some per cent, differently for each
    LED.  The presses that a film model is fitted to must be levelled like the touches that it
    is used for.

    Parameters
    ----------
    light : K x S x W, the presses relative to the film at rest, on a sheet (`sheet`)
    flat : K x H x W, the film at rest
    noise : (shot, read), a captured light I has the variance shot * I + read
    """
    sigma = coarsen(rest_noise(flat, noise))
    levelled = []
    for press in cut(light, flat.shape[1]):
        drift = film_drift(coarsen(press), sigma, degree=DRIFT_DEGREE)
        levelled.append(level_light(press, drift))
    return np.concatenate(levelled, axis=1)
