"""A plate with a groove, whose width, depth and walls are known."""

from __future__ import annotations

import numpy as np

from tactograph.graph import InputError, node
from tactograph.nodes import F8
from tactograph.nodes.optics.shape import (
    PAPER_PIXEL_MM,
    Length,
    Offset,
    PixelSide,
    Shape,
    Side,
    WallAngle,
    grid,
    risen,
    shape,
    turned,
)


@node
def shape_groove(
    *,
    width_mm: Length = 3.0,
    depth_mm: Length = 0.5,
    wall_deg: WallAngle = 40.0,
    side_mm: Length = 12.0,
    angle_deg: float = 0.0,
    offset_mm: Offset = (0.0, 0.0),
    width_px: Side = 320,
    height_px: Side = 240,
    pixel_size_mm: PixelSide = PAPER_PIXEL_MM,
) -> Shape:
    """Return the height of a square plate with a groove across its middle.

    The plate is as high as the groove is deep, so the groove's bottom lies on the plane.  All
    walls, the plate's own too, have the same angle.  `measure_step` finds width and depth again.

    Parameters
    ----------
    width_mm
        Width of the groove at half its depth.
    depth_mm
        Depth of the groove.
    wall_deg
        Angle of the walls against the plane; 90 is vertical.
    side_mm
        Side of the plate at half its height.
    angle_deg
        Azimuth across the groove, from x (right) towards y (down).
    offset_mm
        Middle of the groove from the centre of the image.
    width_px, height_px, pixel_size_mm
        The image.

    Returns
    -------
    Height H x W, mm, and the pixel size.

    Raises
    ------
    InputError
        If the walls leave no bottom, or no plate beside the groove.
    """
    run = depth_mm / np.tan(np.radians(wall_deg))
    if width_mm <= run or side_mm - width_mm <= 2 * run:
        raise InputError(
            f"shape_groove: walls of {wall_deg:g} degrees take {run:.3g} mm each, which leaves no "
            "level at the bottom or beside the groove; make it wider, the plate larger, or the "
            "walls steeper"
        )
    x, y = grid(width_px, height_px, pixel_size_mm, offset_mm)
    across, along = turned(x, y, angle_deg)
    beside: F8 = np.abs(across) - width_mm / 2
    within: F8 = side_mm / 2 - np.maximum(np.abs(across), np.abs(along))
    return shape(risen(np.minimum(beside, within), depth_mm, wall_deg), pixel_size_mm)
