"""Describe the film at rest: its shape, and its light relative to a plane's."""

from typing import NamedTuple

import numpy as np

from tactograph.graph import InputError, NodeCall, node
from tactograph.nodes import F4, Film, Height, Light, PixelSize, RestHeight, Slope
from tactograph.nodes.light.film_bounce import DEFAULT_CELLS, film_bounce
from tactograph.nodes.optics.near_light import matt_film_light
from tactograph.nodes.optics.rest_shape import MIN_REST_LIGHT, REST_ROUNDS, RestShape


class Surface(NamedTuple):
    """The film at rest as the camera sees it, its slope, and the flat frame of a plane.

    `share` is r of F5, `thrown` its part from film to film, and `matt` the light of matt film of
    that shape (N1).  `rest` and `tilt` are the seen height and its slopes, `incline` the film's
    slopes.  All are None for a plane.
    """

    height: Height
    slope: Slope
    flat: Light
    share: Light | None
    thrown: Light | None
    matt: Light | None
    rest: Height | None
    tilt: Slope | None
    incline: Slope | None


@node
def untouched_film(
    flat: Light,
    film: Film | None = None,
    rest: RestHeight | None = None,
    pixel: PixelSize | None = None,
    *,
    bounce: NodeCall = film_bounce,
) -> Surface:
    """Return height and slope of the film at rest, and the flat frame that a plane would have.

    Without `rest` the film is a plane: height and slope are zero, and `flat` is returned.

    Parameters
    ----------
    flat : K x H x W, the film at rest
    film : the LEDs' and the film's properties
    rest
        R x C in mm, the height of the film at rest that each pixel sees; None: a plane.  If it is
        finer than the flat frame, it is averaged over the flat frame's pixels.
    pixel : mm per px of the flat frame

    Raises
    ------
    InputError
        If `rest` is given without `film` and `pixel`.
    """
    size = flat.shape[1:]
    if rest is None:
        zero = np.zeros((2, *size), np.float32)
        return Surface(np.zeros(size, np.float32), zero, flat, *[None] * 6)
    if film is None or pixel is None:
        raise InputError("a film that is no plane needs its calibration and pixel size as well")
    factor = max(-(-side // cells) for side, cells in zip(rest.shape, size, strict=True))
    shape = RestShape.of(rest, pixel / factor, film.camera)
    if factor > 1:
        shape = shape.continued(factor).binned(factor)
    direct, thrown = light_at_rest(shape, film, bounce)
    share = np.maximum(direct + thrown, np.float32(MIN_REST_LIGHT))
    matt = matt_film_light(film.lights, shape.apparent, shape.slope, shape.pixel)
    flat = np.asarray(flat / share, np.float32)
    low = shape.apparent, shape.tilt, shape.slope
    return Surface(shape.apparent, shape.slope, flat, share, thrown, matt, *low)


def light_at_rest(
    shape: RestShape, film: Film, bounce: NodeCall, cells: int = DEFAULT_CELLS
) -> tuple[F4, F4]:
    """Return the two parts of r of F5, K x H x W each: from the LEDs, and from film to film."""
    direct = shape.light(film)
    thrown = np.zeros_like(direct)
    for _ in range(REST_ROUNDS if film.albedo > 0 else 0):
        total = direct + thrown
        thrown = bounce(total, shape.apparent, film, shape.pixel, slope=shape.slope, cells=cells)
    return direct, thrown
