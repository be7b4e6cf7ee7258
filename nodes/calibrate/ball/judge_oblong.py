"""Tell by the balls' contacts where pixels are not square."""

from typing import Annotated

import numpy as np
from annotated_types import Gt

from tactograph.graph import Port, node
from tactograph.nodes import F4, Light, PixelSize
from tactograph.nodes.calibrate import BallCircles, BallPress, BallRadii
from tactograph.nodes.calibrate.ball.ball_search import Circle
from tactograph.nodes.calibrate.ball.find_ball import oblong_of
from tactograph.nodes.optics.rest_shape import RestShape
from tactograph.nodes.optics.sheet import SheetLight, cut

MAX_OBLONG_SHARE = 0.03
"""Ratio of a pixel's sides, less 1, above which pixels are not square..."""
MIN_EXPLAINED = 0.3
"""... where it explains at least this share of the balls' residual."""
MAX_BALLS = 5
"""Most balls that are used: the best suffice."""


@node
def judge_oblong(
    light: SheetLight,
    flat: Light,
    circle: BallCircles,
    goodness: Annotated[F4, Port("B", "1")],
    of: BallPress,
    pixel: PixelSize,
    radius: BallRadii | None = None,
    shape: RestShape | None = None,
    *,
    radius_mm: Annotated[float, Gt(0)] | None = None,
) -> list[str]:
    """Return a doubt if the balls' contacts are ellipses, as on pixels that are not square.

    Parameters
    ----------
    light, flat
        K x S x W, the presses relative to the film at rest, and K x H x W, of which only the size
        is used.
    circle, goodness, of, radius : B x 3 in px, B, B, and B in mm: as `find_balls` returns them
    pixel : mm per px
    shape
        The film at rest if it is no plane: then contacts are no circles, and nothing is told.
    radius_mm : the radius of all balls, where `radius` is not given
    """
    if shape is not None:
        return []
    if radius is None:
        radius = np.full(len(circle), radius_mm, np.float32)
    presses = cut(light, flat.shape[1])
    estimates = [
        oblong_of(presses[of[n]], Circle(*circle[n]), radius[n] / pixel, MAX_OBLONG_SHARE)
        for n in np.argsort(-goodness)[:MAX_BALLS]
        if circle[n, 2] > 0
    ]
    if not estimates:
        return []
    oblong, explained = np.median(estimates, axis=0)
    share = np.expm1(abs(oblong))
    if share < MAX_OBLONG_SHARE or explained < MIN_EXPLAINED:
        return []
    sides = "wider than long" if oblong > 0 else "longer than wide"
    return [
        f"pixels are not square: the balls show them {share:.0%} {sides}; give `pixel`=X,Y, "
        "or measure both with a grid (calibrate_camera)"
    ]
