"""Find the LEDs' positions from the untouched film and objects of known shape."""

from typing import Annotated, NamedTuple

import numpy as np

from tactograph.graph import InputError, Port, SizeLimit, node
from tactograph.nodes import F4, Film, Light, PixelSize, robust_deviation
from tactograph.nodes.calibrate.lights.light_fit import LedFit, other_places
from tactograph.nodes.calibrate.lights.light_samples import Rest, presses_of, samples_for, unreached
from tactograph.nodes.optics.rest_shape import RestShape
from tactograph.nodes.optics.sheet import (
    SheetHeight,
    SheetLabels,
    SheetLight,
    SheetMask,
    SheetSlope,
)


class LightsFit(NamedTuple):
    """A matt film under the LEDs, with the other places that they may have, and the residual."""

    film: Film
    strength: Annotated[F4, Port("K", "1")]
    residual: Annotated[F4, Port("K", "1")]


@node(sizes={"K": SizeLimit(3, 8, "two LEDs leave two slopes, a label has 8 bits")})
def calibrate_lights(
    light: SheetLight,
    flat: Light,
    slope: SheetSlope,
    mask: SheetMask,
    height: SheetHeight,
    lit: SheetLabels,
    pixel: PixelSize,
    slants: Annotated[F4, Port("K 2", "1", low=-1, high=1)] | None = None,
    shape: RestShape | None = None,
) -> LightsFit:
    """Fit the LEDs' positions to the light of known shapes and to the fall-off over the film.

    Robust least squares (Huber) combines two kinds of evidence.  On the object, the light
    relative to the film at rest is n.v (`near_light`, N1).  On the film at rest, each LED's
    light falls off as L_z / |L - P_0|^3, up to a gain common to all LEDs.  An LED is described
    by a strength and by L_x / L_z, L_y / L_z, 1 / L_z, which stay finite for a distant LED.
    The fit also refines the positions of the objects.

    Parameters
    ----------
    light
        K x S x W, the object relative to the film at rest: one capture, or a sheet of
        several (`sheet`).
    flat
        K x H x W, the film at rest.  A uniform one means that none was taken: then the
        positions come from the object alone, and `light` is the light as captured.
    slope, mask, height : 2 x S x W, S x W, S x W in mm: the object, where known
    lit : S x W, the LEDs that reach each pixel
    pixel : mm per px
    slants
        L_x / L_z and L_y / L_z of each LED, from which the search starts; else it starts from the
        objects' light.
    shape
        The film at rest if it is no plane: light relative to it is n.v over that of its own normal.

    Returns
    -------
    A film with nothing but its LEDs: positions K x 3 in mm from the middle of the image, and eight
    sets of them sampled from the uncertainty of the fit, 8 x K x 3 in mm; strength K, the light of
    the film at rest in the middle of the image, if the flat frame is missing (else 1); robust
    standard deviation of the residual on the objects, K.

    Raises
    ------
    InputError
        If an LED reaches fewer than 100 pixels of the objects.
    """
    presses = presses_of(light, slope, mask, height, lit, flat.shape[1])
    presses = [press for press in presses if press.mask.any()]
    if not presses:
        raise InputError("no pixel of the calibration object is known: is it in the frame?")
    most = samples_for(len(presses))
    objects = [press.samples(pixel, most, shape) for press in presses]
    if why := unreached(objects, "the calibration object"):
        raise InputError(why)
    rest, width = Rest.of(flat, pixel, shape), pixel * light.shape[2]
    placed = LedFit.of(objects, rest, width, slants=slants)
    lit = np.hstack([each.lit for each in objects])
    of_leds = zip(placed.object_residuals(objects), lit, strict=True)
    spread = np.array([robust_deviation(residual[lit]) for residual, lit in of_leds])
    others = other_places(objects, rest, placed, width)
    film = Film.matt(placed.lights)._replace(other_lights=others)
    return LightsFit(film, placed.strength, spread.astype(np.float32))
