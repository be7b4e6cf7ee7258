"""A patch of parallel ridges."""

from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Interval

from tactograph.rings.shapes.profiles import WallAngle, risen
from tactograph.sdk import F8, InputError, Length, Shape, ShapeImage, node

Profile = Literal["square", "triangle", "sine"]


class Ridge(NamedTuple):
    """The cross-section of a grating, and whether a ridge or a groove lies in its middle."""

    profile: Profile = "square"
    duty: Annotated[float, Interval(gt=0, lt=1)] = 0.5
    wall_deg: WallAngle = 90.0
    middle: Literal["ridge", "groove"] = "ridge"


@node
def shape_grating(
    *,
    period_mm: Length = 2.0,
    rise_mm: Length = 0.5,
    ridge: Ridge,
    side_mm: Length = 12.0,
    angle_deg: float = 0.0,
    image: ShapeImage,
) -> Shape:
    """Return the height of a grating, to test resolution and ridges that shade grooves.

    With ``middle="groove"`` and a patch less wide than one period and a groove, it is one groove.

    Parameters
    ----------
    period_mm : from ridge to ridge
    rise_mm : height of the ridges; the grooves reach down to the plane
    profile : cross-section of a ridge
    duty : share of a period that the ridge takes; the rest is flat groove
    wall_deg
        Angle of the walls of square ridges, and of the patch; 90 is vertical.  Widths hold at half
        the height.
    middle : what lies in the middle of the patch
    side_mm : side of the square patch that the grating fills
    angle_deg : azimuth across the ridges, from x (right) towards y (down)

    Raises
    ------
    InputError
        If ridges that are not square get an angle of walls, or walls leave no level.
    """
    profile, duty, wall_deg, middle = ridge
    across, along = image.places(angle_deg)
    periods = across / period_mm + (0.5 if middle == "groove" else 0.0)
    phase = np.abs(periods - np.round(periods))
    from_edge = side_mm / 2 - np.maximum(np.abs(across), np.abs(along))
    if wall_deg == 90:
        height = rise_mm * _ridge(phase / (duty / 2), profile)
        return Shape.of(np.where(from_edge >= 0, height, 0.0), image.pixel_size_mm)
    _check_walls(rise_mm / np.tan(np.radians(wall_deg)), period_mm, duty, profile)
    within = np.minimum((duty / 2 - phase) * period_mm, from_edge)
    return Shape.of(risen(within, rise_mm, wall_deg), image.pixel_size_mm)


def _check_walls(run_mm: float, period_mm: float, duty: float, profile: Profile) -> None:
    if profile != "square":
        raise InputError(f"a {profile} has no walls; leave `wall_deg`=90")
    if run_mm >= min(duty, 1 - duty) * period_mm:
        raise InputError(
            f"walls take {run_mm:.3g} mm each, which leaves no level between them; "
            "make `wall_deg` or `period_mm` larger, or `duty` nearer to 0.5"
        )


def _ridge(from_middle: F8, profile: Profile) -> F8:
    """Height 0 to 1 of a ridge; `from_middle` is 0 in its middle and 1 at its foot."""
    t = np.minimum(from_middle, 1.0)
    if profile == "square":
        return np.where(from_middle < 1, 1.0, 0.0)
    if profile == "triangle":
        return np.asarray(1 - t)
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * t))
