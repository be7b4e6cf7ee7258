"""Convert the light of every press into that of a matt film."""

import numpy as np

from tactograph.graph import NodeCall, node
from tactograph.nodes import Film, Light, PixelSize
from tactograph.nodes.light.film_bounce import film_bounce
from tactograph.nodes.light.light_on_plane import light_on_plane
from tactograph.nodes.light.matt_light import matt_light
from tactograph.nodes.optics.rest_shape import RestShape
from tactograph.nodes.optics.sheet import SheetHeight, SheetLight, SheetSlope, cut


@node
def matt_presses(
    light: SheetLight,
    flat: Light,
    slope: SheetSlope,
    height: SheetHeight,
    film: Film,
    pixel: PixelSize,
    shape: RestShape | None = None,
    share: Light | None = None,
    *,
    bounce: NodeCall = film_bounce,
) -> SheetLight:
    """Apply `matt_light` to each press, whose shape is known.

    Parameters
    ----------
    light : K x S x W, the presses relative to the film at rest, on a sheet (`sheet`)
    flat : K x H x W; only its size is used
    slope, height : 2 x S x W, and S x W in mm: of the presses, as `press_slopes` returns them
    film : the LEDs' places in mm and the film's properties
    pixel : mm per px
    shape, share : the film at rest if it is no plane, and r as `untouched_film` returns it
    """
    rows, matt = flat.shape[1], []
    rest = None if shape is None else shape.apparent
    for press, p_q, z in zip(cut(light, rows), cut(slope, rows), cut(height, rows), strict=True):
        press = light_on_plane(press, share)
        bounced = bounce(press, z, film, pixel)
        sigma = np.ones_like(press)
        matt.append(matt_light(press, sigma, p_q, z, film, pixel, bounced, rest=rest).light)
    return np.concatenate(matt, axis=1)
