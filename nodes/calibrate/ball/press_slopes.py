"""The slopes of the balls on a sheet of presses."""

from typing import NamedTuple

import numpy as np

from tactograph.graph import node
from tactograph.nodes import Light, PixelSize
from tactograph.nodes.calibrate import BallCircles, BallPress, BallRadii
from tactograph.nodes.calibrate.ball.ball_on_shape import BallOnShape
from tactograph.nodes.calibrate.ball.ball_search import Circle
from tactograph.nodes.calibrate.ball.ball_slopes import ball_slopes
from tactograph.nodes.optics.rest_shape import RestShape
from tactograph.nodes.optics.sheet import SheetHeight, SheetLight, SheetMask, SheetSlope


class PressSlopes(NamedTuple):
    """Slope and height of every ball pressed into the film, and the pixels where they hold."""

    slope: SheetSlope
    mask: SheetMask
    height: SheetHeight


@node
def press_slopes(
    light: SheetLight,
    flat: Light,
    circle: BallCircles,
    radius: BallRadii,
    of: BallPress,
    pixel: PixelSize,
    shape: RestShape | None = None,
) -> PressSlopes:
    """Return the slopes and heights of `ball_slopes` for each press, on a sheet (`sheet`).

    Parameters
    ----------
    light, flat : K x S x W and K x H x W; only their sizes are used
    circle : B x 3: x, y and contact radius in px; a radius of 0 gives an empty mask
    radius, of : length B: the balls' radii in mm, and the press that each is in
    pixel : mm per px
    shape
        The film at rest if it is no plane: then heights are those above the plane, and slope and
        height beside the balls are its own.
    """
    rows = flat.shape[1]
    slope = np.zeros((2, *light.shape[1:]), np.float32)
    mask, height = np.zeros(light.shape[1:], np.uint8), np.zeros(light.shape[1:], np.float32)
    if shape is not None:
        sheets = light.shape[1] // rows
        slope[:], height[:] = (
            np.tile(shape.slope, (1, sheets, 1)),
            np.tile(shape.height, (sheets, 1)),
        )
    for c, r, press in zip(circle, radius, of, strict=True):
        if shape is None:
            ball = ball_slopes(flat, c[:2], float(c[2]), pixel, radius_mm=float(r))
        elif c[2] > 0:
            ball = BallOnShape(shape, float(r)).slopes(Circle(*map(float, c)))
        else:
            continue
        inside, at = ball.mask > 0, slice(press * rows, (press + 1) * rows)
        slope[:, at][:, inside] = ball.slope[:, inside]
        mask[at][inside] = 1
        height[at][inside] = ball.height[inside]
    return PressSlopes(slope, mask, height)
