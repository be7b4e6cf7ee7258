"""Find the ball in every press."""

from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from tactograph.rings.oneshot.nodes.presses import PressImages
from tactograph.rings.oneshot.nodes.presses.sheet_presses import sheet_presses
from tactograph.sdk import FoundBalls, InputError, Light, PixelSize, StatedCircles, node, warn
from tactograph.sdk.nodes import find_ball, find_balls, flat_presses

MIN_PRESSES = 4


@node
def find_presses(
    image: PressImages,
    flat: Light,
    names: list[str],
    pixel: PixelSize,
    circles: StatedCircles | None = None,
    *,
    radius_mm: Annotated[float, Gt(0)] | None = None,
    pitch_mm: Annotated[float, Gt(0)] | None = None,
    min_balls: Annotated[int, Ge(1)] = MIN_PRESSES,
) -> FoundBalls:
    """Return the contact circle of every press, as `find_ball` finds it.

    A press without a ball is named in a warning and gets a radius of 0, which excludes it from
    all later steps.

    Parameters
    ----------
    image, flat : P x K x H x W presses and the K x H x W film at rest
    names
        The presses' names, for messages.  No names mean that there is no press, and no ball.
    pixel : mm per px
    circles
        P x 3: circles that are known already, as from `guide_colour_presses` or each press's
        ``capture.yaml``; NaN where a number is not known.
    radius_mm : the ball's radius
    pitch_mm
        Pitch of a square grid of balls, of which every press shows several, as for `find_balls`.
        None: every press is one of a single ball.
    min_balls : fewest balls that must be found

    Returns
    -------
    x, y and contact radius in px per ball (pixel centres lie at integers), the goodness of each, 0
    to 1, its radius in mm, the press that it is in, and its name for messages.

    Raises
    ------
    InputError
        If fewer than `min_balls` presses show a ball; if the radius is not given.
    """
    every = np.arange(len(image), dtype=np.int32)
    if not names:
        none = np.zeros(len(image), np.float32)
        return FoundBalls(np.zeros((len(image), 3), np.float32), none, none, every, names)
    if radius_mm is None:
        raise InputError("the ball's radius is not known; give `radius_mm`=MM")
    if circles is None:
        circles = np.full((len(image), 3), np.nan, np.float32)
    radii = np.full(len(image), radius_mm, np.float32)
    if pitch_mm is not None:
        sheet = flat_presses(sheet_presses(image), flat)
        # A printed marker may look like a small ball.
        stated = radii, circles, names, pixel
        found = find_balls(sheet, flat, *stated, pitch_mm=pitch_mm, only_warn=True)
        lines = [
            f"{names[press]}, ball at {x:.0f},{y:.0f} px,"
            for press, (x, y, _) in zip(found.of, found.circle, strict=True)
        ]
        return found._replace(names=lines)
    balls, missed = list[tuple[float, ...]](), []
    for press, name, (x, y, contact) in zip(image, names, circles, strict=True):
        if np.isfinite([x, y, contact]).all():
            balls.append((x, y, contact, contact > 0))
            continue
        light = flat_presses(press, flat)
        center = (float(x), float(y)) if np.isfinite([x, y]).all() else None
        size = float(contact) if np.isfinite(contact) else None
        try:
            ball = find_ball(light, pixel, radius_mm=radius_mm, center_px=center, contact_px=size)
        except InputError:
            missed.append(name or "1")
            balls.append((0.0, 0.0, 0.0, 0.0))
        else:
            balls.append((*ball.center, ball.contact, ball.goodness))
    circles = np.asarray(balls, np.float32)
    ball_count = int(np.count_nonzero(circles[:, 3]))
    if ball_count < min_balls:
        where = f": none in {', '.join(missed)}" if missed else ""
        raise InputError(
            f"a ball of radius {radius_mm:g} mm shows in {ball_count} of {len(image)} presses, and "
            f"{min_balls} are needed{where}; check `radius_mm` and `pixel`, press more often, "
            "give `pitch_mm`=MM if a press shows a grid of balls, or write "
            "ball_center_px: [x, y] and ball_contact_px into a press's capture.yaml"
        )
    for name in missed:
        warn(f"press {name} is left out: no ball of radius {radius_mm:g} mm in it")
    return FoundBalls(circles[:, :3].copy(), circles[:, 3].copy(), radii, every, names)
