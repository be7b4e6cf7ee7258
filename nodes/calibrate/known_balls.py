"""The slopes of the balls on a sheet of presses."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge

from tactograph.graph import node
from tactograph.nodes import Light, PixelSize
from tactograph.nodes.calibrate.ball_slopes import ball_slopes
from tactograph.nodes.calibrate.find_presses import Circles
from tactograph.nodes.capture._sheet import SheetHeight, SheetMask, SheetSlope
from tactograph.nodes.capture.read_balls import Radii


class KnownBalls(NamedTuple):
    """The slope and height of every ball in the film, and the pixels where they hold."""

    slope: SheetSlope
    mask: SheetMask
    height: SheetHeight


@node
def known_balls(
    flat: Light,
    circle: Circles,
    radius: Radii,
    pixel: PixelSize,
    *,
    margin_px: Annotated[float, Ge(0)] = 0.5,
) -> KnownBalls:
    """Return what `ball_slopes` knows of each press, on a sheet (`_sheet`).

    Parameters
    ----------
    flat
        K x H x W; only its size is used.
    circle
        P x 3: x, y and contact radius in px; a radius of 0 gives an empty mask.
    radius
        Of length P, the balls' radii in mm.
    pixel
        mm per px.
    margin_px
        Width of the rim that is left out.
    """
    known = [
        ball_slopes(flat, c[:2], float(c[2]), pixel, radius_mm=float(r), margin_px=margin_px)
        for c, r in zip(circle, radius, strict=True)
    ]
    return KnownBalls(
        np.concatenate([ball.slope for ball in known], axis=1),
        np.concatenate([ball.mask for ball in known], axis=0),
        np.concatenate([ball.height for ball in known], axis=0),
    )
