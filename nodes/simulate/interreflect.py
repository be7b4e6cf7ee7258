"""Add the light reflected from film to film to that of the LEDs."""

from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.graph import NodeCall, node
from tactograph.nodes import F4, Film, Height, Light, LightPositions, PixelSize
from tactograph.nodes.light.film_bounce import film_bounce

MIN_REST_LIGHT = np.float32(1e-6)
CONVERGENCE_THRESHOLD = 1e-5
"""Convergence threshold: change of the light by a bounce, over that of the film at rest."""


@node(neutral="light")
def interreflect(
    light: Light,
    rest: Light,
    height: Height,
    lights: LightPositions,
    pixel: PixelSize,
    *,
    albedo: Annotated[float, Interval(ge=0, le=0.95)] = 0.7,
    bounces: Annotated[int, Interval(ge=1, le=12)] = 8,
    cells: Annotated[int, Interval(ge=1, le=100000)] = 19200,
    rim_mm: Annotated[float, Interval(ge=0, le=50)] = 2.0,
    coat_alpha: Annotated[float, Interval(ge=0, le=1)] = 0.0,
    refractive_index: Annotated[float, Interval(ge=1, le=3)] = 1.5,
    camera_mm: Annotated[float, Interval(ge=0, le=1e6)] = 0.0,
    bounce: NodeCall = film_bounce,
) -> Light:
    """Return the light of a film that lights itself, bounce after bounce.

    Radiosity: each round applies the sum of `film_bounce` to the light of the LEDs plus that of
    the previous round.  A reconstruction that uses the same model recovers the LEDs' light.

    Parameters
    ----------
    light : K x H x W, from the LEDs alone
    rest : K x H x W, the same for the film at rest
    height : H x W in mm
    lights : K x 3 in mm
    pixel : mm per px
    albedo : share of the light that the film reflects; 0 is a film that does not light itself
    bounces : most bounces; at an albedo of 0.7 the light has converged to a thousandth after 5
    cells : about how many cells a frame has, which are squares of pixels
    rim_mm : how far the film extends beyond the frame, flat and at rest
    coat_alpha, refractive_index, camera_mm
        As for `render`: roughness of a coat (0 for none), its index, and height of the pupil.
    bounce : `film_bounce`, on a device if there is one
    """
    film = Film.matt(lights)._replace(
        base=albedo,
        albedo=albedo,
        rim=rim_mm,
        roughness=coat_alpha,
        refraction=refractive_index if coat_alpha > 0 else 1.0,
        camera=1 / camera_mm if camera_mm else 0.0,
    )
    if albedo == 0:
        return light.copy()
    direct: F4 = np.divide(light, np.maximum(rest, MIN_REST_LIGHT), dtype=np.float32)
    more = np.zeros_like(direct)
    for _ in range(bounces):
        before = more
        more = bounce(direct + more, height, film, pixel, cells=cells, from_above=True)
        if np.abs(more - before).max() < CONVERGENCE_THRESHOLD:
            break
    # Extrapolation from two sizes of cells may be negative at the foot of a wall.
    return np.asarray(np.maximum(light + rest * more, np.float32(0)))
