"""A staircase."""

from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.rings.shapes.profiles import WallAngle, risen
from tactograph.sdk import Length, Shape, ShapeImage, node


@node
def shape_steps(
    *,
    count: Annotated[int, Interval(ge=1, le=10_000)] = 4,
    tread_mm: Length = 2.0,
    step_mm: Length = 0.4,
    breadth_mm: Length = 10.0,
    wall_deg: WallAngle = 90.0,
    angle_deg: float = 0.0,
    image: ShapeImage,
) -> Shape:
    """Return the height of a staircase, with walls of known height and angle.

    Parameters
    ----------
    count : number of steps; the last is `count` times `step_mm` high
    tread_mm : depth of a step, in the direction in which the stairs climb
    step_mm : rise from one step to the next
    breadth_mm : extent across the direction of the climb
    wall_deg
        Angle of the walls between the steps and of those around the staircase; 90 is vertical.
    angle_deg : azimuth in which the stairs climb, from x (right) towards y (down)
    """
    along, across = image.places(angle_deg)
    if wall_deg == 90:
        tread = np.floor(along / tread_mm + count / 2)
        on_stairs = (tread >= 0) & (tread < count) & (np.abs(across) <= breadth_mm / 2)
        return Shape.of(np.where(on_stairs, (tread + 1) * step_mm, 0.0), image.pixel_size_mm)
    top = count * step_mm
    starts = (np.arange(count) - count / 2) * tread_mm
    stairs = sum(risen(along - start, step_mm, wall_deg) for start in starts)
    around = np.minimum(count * tread_mm / 2 - along, breadth_mm / 2 - np.abs(across))
    return Shape.of(np.minimum(stairs, risen(around, top, wall_deg)), image.pixel_size_mm)
