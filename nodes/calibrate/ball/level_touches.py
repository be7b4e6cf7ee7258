"""Remove the drift of the light from every press on a sheet."""

import numpy as np

from tactograph.graph import node
from tactograph.nodes import CoarseLight, Light, Noise
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.light.film_drift import Drift, film_drift
from tactograph.nodes.light.level_light import level_light
from tactograph.nodes.light.light_noise import rest_noise
from tactograph.nodes.optics.sheet import SheetLight, cut


@node(neutral="light")
def level_touches(light: SheetLight, flat: Light, noise: Noise) -> SheetLight:
    """Divide each press by the factor of each LED since the flat frame.

    LEDs flicker, and pressed film brightens the untouched film around it, differently for each
    LED.  A factor that varied over the film would also take the slopes of film that a thick gel
    lifts all around the ball for drift, and the heights of such gels would be too large.

    Parameters
    ----------
    light : K x S x W, the presses relative to the film at rest, on a sheet (`sheet`)
    flat : K x H x W, the film at rest
    noise : (shot, read), a captured light I has the variance shot * I + read
    """
    sigma, presses = coarsen(rest_noise(flat, noise)), cut(light, flat.shape[1])
    return np.concatenate([level_light(p, press_drift(p, sigma)) for p in presses], axis=1)


def press_drift(press: Light, sigma: CoarseLight, bounced: CoarseLight | None = None) -> Drift:
    """Return the drift of a press, K x H x W, from its cells: a factor for each LED.

    Parameters
    ----------
    press : relative to the film at rest
    sigma, bounced : on cells, the noise of a pixel, and known light from film to film
    """
    return film_drift(coarsen(press), sigma, bounced=bounced)
