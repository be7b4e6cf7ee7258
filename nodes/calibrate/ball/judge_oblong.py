"""Tell by a ball's contact where pixels are not square."""

from typing import Annotated

import numpy as np

from tactograph.graph import Port, node
from tactograph.nodes import F4, Light, PixelSize
from tactograph.nodes.calibrate import BallCircles, BallPress, BallRadii
from tactograph.nodes.calibrate.ball.ball_search import Circle
from tactograph.nodes.calibrate.ball.find_ball import oblong_of
from tactograph.nodes.calibrate.rating.verdict import Odds
from tactograph.nodes.optics.rest_shape import RestShape
from tactograph.nodes.optics.sheet import SheetLight, cut


@node
def judge_oblong(
    light: SheetLight,
    flat: Light,
    circle: BallCircles,
    goodness: Annotated[F4, Port("B", "1")],
    of: BallPress,
    pixel: PixelSize,
    radius: BallRadii,
    shape: RestShape | None = None,
) -> list[str]:
    """Return a doubt if the best ball's contact is an ellipse, as on pixels that are not square.

    Pixels of other sides have to be likelier by sure `Odds`.  What a ball leaves of
    the light is smooth, so that it counts as few independent values, as in `judge_radius`.

    Parameters
    ----------
    light, flat
        K x S x W, the presses relative to the film at rest, and K x H x W, of which only the size
        is used.
    circle, goodness, of, radius : B x 3 in px, B, B, and B in mm: as `find_balls` returns them
    pixel : mm per px
    shape
        The film at rest if it is no plane: then contacts are no circles, and nothing is doubted.
    """
    best = int(np.argmax(np.where(circle[:, 2] > 0, goodness, -1)))
    if shape is not None or not circle[best, 2]:
        return []
    press = cut(light, flat.shape[1])[of[best]]
    oblong, square, free = oblong_of(press, Circle(*circle[best]), radius[best] / pixel)
    if not Odds.of_frame(square, free, 1, len(flat)).are_sure:
        return []
    sides = "wider than long" if oblong > 0 else "longer than wide"
    return [
        f"pixels are not square: a ball shows them {np.expm1(abs(oblong)):.1%} {sides}; give "
        "`pixel`=X,Y, or measure both with a grid (calibrate_camera)"
    ]
