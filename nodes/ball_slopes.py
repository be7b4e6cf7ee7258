"""The slopes of the calibration ball, from its place and radius."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from tactograph.graph import Close, Port, node
from tactograph.nodes import F4, KnownSlopes, Light, PixelSize


@node(tolerance=Close(1e-5, 1e-5, why="square root and division near the rim"))
def ball_slopes(
    light: Light,
    center: Annotated[F4, Port("2", "px", low=0, high=40)],
    contact: Annotated[float, Port(unit="px", low=3, high=30)],
    pixel: PixelSize,
    *,
    radius_mm: Annotated[float, Gt(0)],
    margin_px: Annotated[float, Ge(0)] = 0.5,
) -> KnownSlopes:
    """Return the slope of a ball of known radius inside its contact circle (paper 3.1).

    With z = sqrt(R^2 - r^2), p = -(x - c_x) / z and q = -(y - c_y) / z.

    Parameters
    ----------
    light
        K x H x W; only its size is used.
    center
        x, y of the ball's centre in px, pixel centres at integers.
    contact
        Radius of the contact circle in px.
    pixel
        mm per px.
    radius_mm
        The ball's radius.
    margin_px
        Width of the rim that is left out: pixels there see ball and film mixed.

    Returns
    -------
    KnownSlopes
        Slope 2 x H x W (zero outside) and the mask of the contact.
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
    return KnownSlopes(np.asarray(slope + np.float32(0), np.float32), inside.astype(np.uint8))


ball_slopes.opencl(grid="H W")
