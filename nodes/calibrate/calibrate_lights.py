"""Find where the LEDs are, from the untouched film and objects of known shape."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt

from tactograph.graph import InputError, Port, SizeLimit, node
from tactograph.nodes import F4, Light, LightPlaces, LightPositions, PixelSize
from tactograph.nodes.calibrate._light_fit import (
    FEWEST,
    other_places,
    place_leds,
    presses_of,
    residual_of,
    rest_of,
    sample,
    samples_for,
    spread_of,
    unreached,
)
from tactograph.nodes.capture._sheet import (
    SheetHeight,
    SheetLabels,
    SheetLight,
    SheetMask,
    SheetSlope,
)


class LightsFit(NamedTuple):
    """The LEDs, and what the fit leaves over."""

    lights: LightPositions
    strength: Annotated[F4, Port("K", "1")]
    residual: Annotated[F4, Port("K", "1")]
    others: LightPlaces


@node(sizes={"K": SizeLimit(3, 8, "two LEDs leave two slopes, a label has 8 bits")})
def calibrate_lights(
    light: SheetLight,
    flat: Light,
    slope: SheetSlope,
    mask: SheetMask,
    height: SheetHeight,
    lit: SheetLabels,
    pixel: PixelSize,
    *,
    steepest: Annotated[float, Gt(0)] = 3.0,
    shift_px: Annotated[float, Gt(0)] = 0.5,
) -> LightsFit:
    """Fit the LEDs' positions to known shapes' light and to the fall-off over the film.

    Robust least squares (Huber) over two kinds of evidence: on the object, the light
    relative to the film at rest is n.v (`_near_light`, N1); on the film at rest, each LED's
    light falls off as L_z / |L - P_0|^3, up to a gain that all share.  An LED is described
    by L_x / L_z, L_y / L_z, 1 / L_z, which stay finite for a distant one, and a strength;
    the places of the objects are refined with them.

    Parameters
    ----------
    light
        K x S x W of the object, relative to the film at rest: one capture, or a sheet of
        several (`_sheet`).
    flat
        K x H x W, the film at rest.  Where it is uniform there was none: then the positions
        come from the object alone, and `light` is what was captured.
    slope, mask, height
        2 x S x W, S x W, S x W in mm: the object, where known.
    lit
        S x W, the LEDs that reach each pixel.
    pixel
        mm per px.
    steepest
        Pixels steeper than this (mm per mm) are left out: there shape is least certain.
    shift_px
        Standard deviation of the object's place along x and along y.

    Returns
    -------
    LightsFit
        Positions K x 3 in mm from the middle of the image; strength K, the light of the film
        at rest in the middle of the image, where the flat frame is missing (else 1); the
        root mean square that the fit leaves on the objects, of length K; eight other places
        of the LEDs, 8 x K x 3 in mm, that the fit allows.

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
    objects = [sample(press, pixel, steepest, most) for press in presses]
    dark = unreached(objects)
    if dark:
        raise InputError(
            f"LED {dark[0]} reaches only {dark[1]} pixels of the calibration object "
            f"({FEWEST} are needed): is it on?"
        )
    rest, width = rest_of(flat, pixel), pixel * light.shape[2]
    placed = place_leds(objects, rest, shift_px, width)
    left = [
        residual_of(there, placed.leds, shift, placed.flat)
        for there, shift in zip(objects, placed.shifts, strict=True)
    ]
    spread = spread_of(np.hstack(left), np.hstack([there.lit for there in objects]))
    others = other_places(objects, rest, placed, shift_px, width)
    return LightsFit(placed.lights, placed.strength, spread.astype(np.float32), others)
