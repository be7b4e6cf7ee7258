"""LED positions of a simulated sensor."""

from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval

from tactograph.graph import InputError, node
from tactograph.nodes import F4, LightPositions

MAX_LIGHTS = 8
"""A label is a byte with one bit per LED."""


@node
def light_ring(
    *,
    count: Annotated[int, Interval(ge=3, le=MAX_LIGHTS)] = 4,
    slant_deg: Annotated[float, Interval(ge=0, lt=90)] = 28.0,
    first_azimuth_deg: float = 45.0,
    distance_mm: Annotated[float, Gt(0)] = 380.0,
    positions_mm: list[tuple[float, float, float]] | None = None,
) -> LightPositions:
    """Return LED positions evenly spaced on a circle around the camera (figure 1).

    Figure 2's numbers follow from the slant: D = distance * sin(slant), h = distance *
    cos(slant).  The paper's prototype (D = 30 mm, h = 200 mm) is slant 8.53 degrees at
    202.2 mm, its intended finger (D = h = 5 mm) is slant 45 degrees at 7.07 mm.

    Parameters
    ----------
    count : number of LEDs, K
    slant_deg : angle between the direction to an LED and the z axis, at the centre of the film
    first_azimuth_deg
        Azimuth of LED 1, counted from x (right) towards y (down); the others follow in
        that sense, 360 / K degrees apart.
    distance_mm : from the centre of the film to each LED
    positions_mm : explicit positions (x right, y down, z towards the camera), instead of a ring

    Returns
    -------
    K x 3, mm; the origin is the centre of the image, pixel ((W-1)/2, (H-1)/2).

    Raises
    ------
    InputError
        If explicit positions are too few, too many, or not in front of the film.
    """
    if positions_mm is not None:
        return _checked(positions_mm)
    azimuth = np.deg2rad(first_azimuth_deg + 360.0 / count * np.arange(count))
    slant = np.deg2rad(slant_deg)
    direction = [
        np.sin(slant) * np.cos(azimuth),
        np.sin(slant) * np.sin(azimuth),
        np.full(count, np.cos(slant)),
    ]
    return np.asarray(distance_mm * np.stack(direction, axis=1), np.float32)


def _checked(positions: list[tuple[float, float, float]]) -> F4:
    if not 3 <= len(positions) <= MAX_LIGHTS:
        raise InputError(
            f"light_ring: positions_mm holds {len(positions)} LEDs; give 3 to {MAX_LIGHTS}"
        )
    for k, (_, _, z) in enumerate(positions, start=1):
        if z <= 0:
            raise InputError(
                f"light_ring: LED {k} in positions_mm stands at z = {z:g} mm, not in front of "
                "the film; z points towards the camera and must be above 0"
            )
    return np.asarray(positions, np.float32)
