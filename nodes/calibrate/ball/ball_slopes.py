"""The slopes of the calibration ball, from its position and radius."""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Gt

from tactograph.graph import Close, Port, node
from tactograph.nodes import F4, Height, Light, Mask, PixelSize, Slope


class BallSlopes(NamedTuple):
    """Slope and height of a ball pressed into the film, and the pixels where they hold."""

    slope: Slope
    mask: Mask
    height: Height


@node(tolerance=Close(1e-5, 1e-5, why="square root and division near the rim"))
def ball_slopes(
    light: Light,
    center: Annotated[F4, Port("2", "px", low=0, high=40)],
    contact: Annotated[float, Port(unit="px", low=3, high=30)],
    pixel: PixelSize,
    *,
    radius_mm: Annotated[float, Gt(0)],
    margin_px: Annotated[float, Ge(0)] = 0.5,
) -> BallSlopes:
    """Return the slope of a ball of known radius inside its contact circle (paper 3.1).

    With z = sqrt(R^2 - r^2), p = -(x - c_x) / z and q = -(y - c_y) / z.  The ball rises
    z - sqrt(R^2 - c^2) above the film at rest, where c is the radius of its contact.

    Parameters
    ----------
    light : K x H x W; only its size is used
    center : x, y of the ball's centre in px; pixel centres lie at integers
    contact : radius of the contact circle in px
    pixel : mm per px
    radius_mm : the ball's radius
    margin_px : width of the rim that is left out, because its pixels mix ball and film

    Returns
    -------
    Slope 2 x H x W, mask of the contact, height H x W in mm; all zero outside the contact.
    """
    height, width = light.shape[1:]
    y, x = np.mgrid[:height, :width].astype(np.float32)
    dx = (x - center[0]) * np.float32(pixel)
    dy = (y - center[1]) * np.float32(pixel)
    square = dx * dx + dy * dy
    rim = (np.float32(contact) - np.float32(margin_px)) * np.float32(pixel)
    ball = np.float32(radius_mm) * np.float32(radius_mm)
    inside = (rim > 0) & (square < rim * rim) & (square < ball)
    z = np.sqrt(np.where(inside, ball - square, np.float32(1)))
    slope = np.stack([-dx / z, -dy / z]) * inside
    reach = np.float32(contact) * np.float32(pixel)
    base = np.sqrt(np.maximum(ball - reach * reach, np.float32(0)))
    rise = np.where(inside, z - base, np.float32(0))
    return BallSlopes(
        np.asarray(slope + np.float32(0), np.float32),
        inside.astype(np.uint8),
        np.asarray(rise, np.float32),
    )


ball_slopes.opencl(grid="H W")
