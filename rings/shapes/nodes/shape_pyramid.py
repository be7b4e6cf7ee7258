"""A pyramid with a regular base."""

from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.sdk import Length, Shape, ShapeImage, node


@node
def shape_pyramid(
    *,
    faces: Annotated[int, Interval(ge=3, le=64)] = 4,
    inradius_mm: Length = 4.0,
    rise_mm: Length = 3.0,
    angle_deg: float = 0.0,
    image: ShapeImage,
) -> Shape:
    """Return the height of a pyramid, with plane faces of one slope each and sharp ridges.

    Parameters
    ----------
    faces : number of faces
    inradius_mm : distance from the axis to the foot of a face, perpendicular to the foot
    rise_mm : height of the tip above the plane
    angle_deg : azimuth of the first face, from x (right) towards y (down)
    """
    x, y = image.places()
    azimuth = np.deg2rad(angle_deg + 360.0 / faces * np.arange(faces))
    outwards = np.max([np.cos(a) * x + np.sin(a) * y for a in azimuth], axis=0)
    return Shape.of(rise_mm * (1 - outwards / inradius_mm), image.pixel_size_mm)
