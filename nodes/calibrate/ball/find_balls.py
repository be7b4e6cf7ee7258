"""Find the ball in every press of a calibration.

Long because a sheet of balls is found by its lattice (`_ball_grid`), unlike a press of one ball.
"""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt

from tactograph.graph import InputError, Port, node, warn
from tactograph.nodes import F4, Light, PixelSize
from tactograph.nodes.calibrate import BallCircles, BallPress, BallRadii
from tactograph.nodes.calibrate.ball._ball_grid import Grid, find_grid, place_balls
from tactograph.nodes.calibrate.ball.ball_search import CONTACT_SHARES
from tactograph.nodes.calibrate.ball.find_ball import Ball, find_ball
from tactograph.nodes.calibrate.lights.light_samples import Rest
from tactograph.nodes.calibrate.rating.judge_flat import RETAKE_FLAT, is_uneven
from tactograph.nodes.capture.read_balls import Marks, Radii, StatedCircles
from tactograph.nodes.optics.rest_shape import MIN_REST_LIGHT, RestShape
from tactograph.nodes.optics.sheet import SheetLight, cut

MARKING_ADVICE = (
    "check `radius` and `pixel`; if there is one, say where in its capture.yaml "
    "(ball_center_px: [x, y], ball_contact_px: r)"
)

TOUCHED_FLAT = f"the flat frame is lit unevenly, as by a touch: {RETAKE_FLAT}"


class FoundBalls(NamedTuple):
    """Circle, goodness, radius and press of every ball, and the presses' names."""

    circle: BallCircles
    goodness: Annotated[F4, Port("B", "1")]
    radius: BallRadii
    of: BallPress
    names: list[str]


@node
def find_balls(
    light: SheetLight,
    flat: Light,
    radius: Radii,
    circles: StatedCircles,
    names: list[str],
    pixel: PixelSize,
    marks: Marks | None = None,
    shape: RestShape | None = None,
    *,
    pitch_mm: Annotated[float, Gt(0)] | None = None,
    only_warn: bool = False,
) -> FoundBalls:
    """Return the contact circle of every press, as `find_ball` finds it, or its grid of balls.

    A press without a ball is named in a warning and gets a radius of 0, which excludes it from
    all later steps.  A single press without a ball is refused, and so is a flat frame with one.

    Parameters
    ----------
    light : K x S x W, the presses relative to the film at rest
    flat : K x H x W, the film at rest; blamed for a ball that is not found if it is no such film
    radius, circles, names
        P in mm, P x 3 in px, P: as `read_balls` returns them.  No names: no press, no ball.
    pixel : mm per px
    marks
        M x 3 in px, balls that were marked by hand, as `read_balls` gives them: where a press has
        some, these are its balls, and none are searched for.
    shape : the film at rest if it is no plane
    pitch_mm
        Pitch of a square grid of balls, of which every press shows several (`_ball_grid`).
        None: every press is one of a single ball.
    only_warn : whether a flat frame that shows a ball is left to later nodes, which doubt it

    Returns
    -------
    x, y and contact radius in px (pixel centres lie at integers), goodness from 0 to 1, radius in
    mm and press of each ball.

    Raises
    ------
    InputError
        If no press shows its ball, or the flat frame does; if the balls of a grid overlap, or lie
        on a film that is no plane.
    """
    if not names:
        none = np.zeros(len(radius), np.float32)
        circles = np.zeros((len(radius), 3), np.float32)
        return FoundBalls(circles, none, radius, none.astype(np.int32), names)
    if shape is not None and (pitch_mm is not None or marks is not None):
        raise InputError(
            "a grid of balls is for film that is flat at rest: press single balls, one a press"
        )
    is_touched = is_uneven(flat, pixel)
    if is_touched and shape is None and not only_warn:
        _refuse_pressed(flat, light, radius, pixel)
    if pitch_mm is not None or marks is not None:
        none = np.zeros((0, 3), np.float32)
        return _grids(light, flat, radius, names, pixel, pitch_mm, none if marks is None else marks)
    balls: list[Ball | None] = []
    presses = zip(cut(light, flat.shape[1]), radius, circles, names, strict=True)
    for press, size, circle, name in presses:
        x, y, contact = (None if np.isnan(value) else float(value) for value in circle)
        center = None if x is None or y is None else (x, y)
        try:
            ball = find_ball(
                press, pixel, shape, radius_mm=float(size), center_px=center, contact_px=contact
            )
        except InputError as error:
            reason = str(error).partition("; ")[0]
            advice = f"{reason}; {MARKING_ADVICE}; else press again"
            if len(names) == 1:
                raise InputError(f"{TOUCHED_FLAT} ({reason})" if is_touched else advice) from None
            warn(f"press {name} is left out: {reason}; {MARKING_ADVICE}")
            ball = None
        balls.append(ball)
    if not any(balls):
        cure = TOUCHED_FLAT if is_touched else "check `radius` and `pixel`"
        raise InputError(f"none of {len(names)} presses shows its ball; {cure}")
    return FoundBalls(
        np.array([(*b.center, b.contact) if b else (0, 0, 0) for b in balls], np.float32),
        np.array([b.goodness if b else 0 for b in balls], np.float32),
        radius,
        np.arange(len(balls), dtype=np.int32),
        names,
    )


def _refuse_pressed(flat: F4, light: F4, radius: F4, pixel: float) -> None:
    """Refuse an uneven flat frame that shows a ball, as then all film beside it seems to sink.

    A ball that is large enough to be found makes a press uneven, too.
    """
    divisor = np.maximum(flat, np.float32(MIN_REST_LIGHT))
    if not any(is_uneven(press * divisor, pixel) for press in cut(light, flat.shape[1])):
        raise InputError(
            "the capture shows untouched film, and the flat frame a touch: exchange the two"
        )
    try:
        ball = find_ball(flat, pixel, radius_mm=float(radius.max()))
    except InputError:
        return
    # Dirt may be as round, but is smaller than a contact.
    if ball.contact > CONTACT_SHARES[-1] * radius.max() / pixel:
        x, y = ball.center
        raise InputError(f"{TOUCHED_FLAT} (it shows a ball at {x:.0f},{y:.0f} px)")


def _grids(
    light: F4,
    flat: F4,
    radius: F4,
    names: list[str],
    pixel: float,
    pitch_mm: float | None,
    marks: F4,
) -> FoundBalls:
    """The balls of presses that each show a grid of balls."""
    rest = Rest.of(flat, pixel)
    grids = []
    if pitch_mm is not None and 2 * radius.max() > pitch_mm:
        raise InputError(
            f"`pitch_mm`={pitch_mm:g}: balls of {2 * radius.max():g} mm diameter do not fit"
        )
    for number, (press, size) in enumerate(zip(cut(light, flat.shape[1]), radius, strict=True)):
        radius_px, why = float(size) / pixel, "it shows no grid of four balls or more"
        marked = marks[marks[:, 2] == number, :2].astype(float)
        if len(marked):
            marked_grid = Grid(marked, np.ones(len(marked)))
            grid = place_balls(press, marked_grid, radius_px, pixel, rest)
        elif pitch_mm is not None:
            grid = find_grid(press, radius_px, pitch_mm / pixel, pixel, rest)
        else:
            grid, why = None, "unlike others it has no marks; they need none with `pitch_mm`=MM"
        if grid is not None:
            grids.append((number, grid))
        elif len(names) > 1:
            warn(f"press {names[number]} is left out: {why}")
    if not grids:
        raise InputError(
            f"none of {len(names)} presses shows a grid of balls; check `radius`, `pitch_mm` and "
            "`pixel`"
        )
    numbers, placed = zip(*grids, strict=True)
    circle, goodness = (np.concatenate(p).astype(np.float32) for p in zip(*placed, strict=True))
    of = np.repeat(np.array(numbers, np.int32), [len(grid.circle) for grid in placed])
    return FoundBalls(circle, goodness, radius[of].astype(np.float32), of, names)
