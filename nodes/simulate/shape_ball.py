"""A ball: a hemisphere on the plane, a full ball lying on it, or a spherical cap."""

import numpy as np

from tactograph.graph import InputError, node
from tactograph.nodes.optics.shape import Length, Shape, ShapeImage


@node
def shape_ball(
    *,
    radius_mm: Length = 7.0,
    rise_mm: Length | None = None,
    image: ShapeImage,
) -> Shape:
    """Return the height of a ball seen from above, H x W in mm above the plane.

    The default is the paper's calibration ball (7 mm) as a hemisphere on the plane; radius
    5 mm is its "unknown" ball (section 4.1).

    Parameters
    ----------
    radius_mm : radius of the ball
    rise_mm
        Height of the ball's top above the plane: the radius (the default) for a hemisphere,
        less for a spherical cap, twice the radius for a ball lying on the plane.

    Raises
    ------
    InputError
        If the top would be higher than the ball.
    """
    rise = radius_mm if rise_mm is None else rise_mm
    if rise > 2 * radius_mm:
        raise InputError(
            f"`rise_mm`={rise:g} is more than the ball's diameter "
            f"{2 * radius_mm:g}; give at most that"
        )
    x, y = image.places()
    inside = radius_mm**2 - x**2 - y**2
    surface = rise - radius_mm + np.sqrt(np.maximum(inside, 0.0))
    return Shape.of(np.where(inside > 0, surface, 0.0), image.pixel_size_mm)
