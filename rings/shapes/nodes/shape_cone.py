"""A cone or frustum standing on the plane."""

from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.sdk import InputError, Length, Shape, ShapeImage, node


@node
def shape_cone(
    *,
    radius_mm: Length = 5.0,
    rise_mm: Length = 3.0,
    top_radius_mm: Annotated[float, Interval(ge=0, le=1e4)] = 0.0,
    image: ShapeImage,
) -> Shape:
    """Return the height of a cone, which has one slope in every direction.

    Parameters
    ----------
    radius_mm : radius of the base
    rise_mm : height of the top above the plane
    top_radius_mm : radius of the flat top; 0 for a point

    Raises
    ------
    InputError
        If the top is not narrower than the base.
    """
    if top_radius_mm >= radius_mm:
        raise InputError(
            f"`top_radius_mm`={top_radius_mm:g} is not below "
            f"`radius_mm`={radius_mm:g}; make the top narrower"
        )
    x, y = image.places()
    share = (radius_mm - np.sqrt(x**2 + y**2)) / (radius_mm - top_radius_mm)
    return Shape.of(rise_mm * np.clip(share, 0.0, 1.0), image.pixel_size_mm)
