"""The parameters that both guided calibrations share."""

from pathlib import Path
from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt


class GuideParams(NamedTuple):
    """The ball, the calibration's file, the images' size, and the patience with the user.

    Parameters
    ----------
    ball_radius_mm : the ball's radius
    file : the calibration to write
    width_px, height_px : image size to request from the camera; None keeps the driver's
    still_s : how long a press must be held still
    patience_s : how long to wait for the next press
    """

    ball_radius_mm: Annotated[float, Gt(0)]
    file: Path
    width_px: Annotated[int, Ge(1)] | None = None
    height_px: Annotated[int, Ge(1)] | None = None
    still_s: Annotated[float, Gt(0)] = 0.4
    patience_s: Annotated[float, Gt(0)] = 120.0
