"""A ball: a hemisphere on the plane, a full ball lying on it, or a spherical cap."""

from __future__ import annotations

import numpy as np

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
def shape_ball(
    *,
    radius_mm: Length = 7.0,
    rise_mm: Length | None = None,
    offset_mm: Offset = (0.0, 0.0),
    width_px: Side = 320,
    height_px: Side = 240,
    pixel_size_mm: PixelSide = PAPER_PIXEL_MM,
) -> Shape:
    """Return the height of a ball seen from above.

    The default is the paper's calibration ball (7 mm) as a hemisphere on the plane; radius
    5 mm is its "unknown" ball (section 4.1).

    Parameters
    ----------
    radius_mm
        Radius of the ball.
    rise_mm
        Height of the ball's top above the plane: the radius (the default) for a hemisphere,
        less for a spherical cap, twice the radius for a ball lying on the plane.
    offset_mm
        Centre of the ball from the centre of the image.
    width_px, height_px, pixel_size_mm
        The image.

    Returns
    -------
    Height H x W, mm, and the pixel size.

    Raises
    ------
    InputError
        If the top would be higher than the ball.
    """
    rise = radius_mm if rise_mm is None else rise_mm
    if rise > 2 * radius_mm:
        raise InputError(
            f"shape_ball: rise_mm = {rise:g} is more than the ball's diameter "
            f"{2 * radius_mm:g}; give at most that"
        )
    x, y = grid(width_px, height_px, pixel_size_mm, offset_mm)
    inside = radius_mm**2 - x**2 - y**2
    surface = rise - radius_mm + np.sqrt(np.maximum(inside, 0.0))
    return shape(np.where(inside > 0, surface, 0.0), pixel_size_mm)
