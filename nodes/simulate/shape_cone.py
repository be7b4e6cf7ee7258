"""A cone or frustum standing on the plane."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.graph import InputError, node
from tactograph.nodes.optics.shape import (
    PAPER_PIXEL_MM,
    Length,
    Offset,
    PixelSide,
    Shape,
    Side,
    grid,
    shape,
)


@node
def shape_cone(
    *,
    radius_mm: Length = 5.0,
    rise_mm: Length = 3.0,
    top_radius_mm: Annotated[float, Interval(ge=0, le=1e4)] = 0.0,
    offset_mm: Offset = (0.0, 0.0),
    width_px: Side = 320,
    height_px: Side = 240,
    pixel_size_mm: PixelSide = PAPER_PIXEL_MM,
) -> Shape:
    """Return the height of a cone, which has one slope in every direction.

    Parameters
    ----------
    radius_mm
        Radius of the base.
    rise_mm
        Height of the top above the plane.
    top_radius_mm
        Radius of the flat top; 0 for a point.
    offset_mm
        Axis of the cone from the centre of the image.
    width_px, height_px, pixel_size_mm
        The image.

    Returns
    -------
    Height H x W, mm, and the pixel size.

    Raises
    ------
    InputError
        If the top is not narrower than the base.
    """
    if top_radius_mm >= radius_mm:
        raise InputError(
            f"shape_cone: top_radius_mm = {top_radius_mm:g} is not below "
            f"radius_mm = {radius_mm:g}; make the top narrower"
        )
    x, y = grid(width_px, height_px, pixel_size_mm, offset_mm)
    share = (radius_mm - np.sqrt(x**2 + y**2)) / (radius_mm - top_radius_mm)
    return shape(rise_mm * np.clip(share, 0.0, 1.0), pixel_size_mm)
