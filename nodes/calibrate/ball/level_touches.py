"""Remove the drift of the light from every press on a sheet."""

import numpy as np

from tactograph.graph import node
from tactograph.nodes import CoarseLight, Light, Noise
from tactograph.nodes.calibrate import DRIFT_DEGREE
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.light.film_drift import Drift, film_drift
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
    sigma, presses = coarsen(rest_noise(flat, noise)), cut(light, flat.shape[1])
    return np.concatenate([level_light(p, press_drift(p, sigma)) for p in presses], axis=1)


def press_drift(press: Light, sigma: CoarseLight, bounced: CoarseLight | None = None) -> Drift:
    """Return the drift of a press, K x H x W, from its cells.

    Parameters
    ----------
    press : relative to the film at rest
    sigma, bounced : on cells, the noise of a pixel, and known light from film to film
    """
    return film_drift(coarsen(press), sigma, bounced=bounced, degree=DRIFT_DEGREE)
