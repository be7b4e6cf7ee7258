"""LED positions of a simulated sensor."""

from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval, Len

from tactograph.graph import node
from tactograph.nodes import LightPositions

MAX_LIGHTS = 8
"""A label is a byte with one bit per LED."""
Place = tuple[float, float, Annotated[float, Gt(0)]]
"""x, y, z of an LED in mm, in front of the film: z points towards the camera."""


@node
def light_ring(
    *,
    count: Annotated[int, Interval(ge=3, le=MAX_LIGHTS)] = 4,
    slant_deg: Annotated[float, Interval(ge=0, lt=90)] = 28.0,
    first_azimuth_deg: float = 45.0,
    distance_mm: Annotated[float, Gt(0)] = 380.0,
    positions_mm: Annotated[list[Place], Len(3, MAX_LIGHTS)] | None = None,
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
    """
    if positions_mm is not None:
        return np.asarray(positions_mm, np.float32)
    azimuth = np.deg2rad(first_azimuth_deg + 360.0 / count * np.arange(count))
    slant = np.deg2rad(slant_deg)
    direction = [
        np.sin(slant) * np.cos(azimuth),
        np.sin(slant) * np.sin(azimuth),
        np.full(count, np.cos(slant)),
    ]
    return np.asarray(distance_mm * np.stack(direction, axis=1), np.float32)
