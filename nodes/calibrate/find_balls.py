"""Find the ball in every press of a calibration."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from tactograph.graph import InputError, Port, node, warn
from tactograph.nodes import F4, Light, PixelSize
from tactograph.nodes.calibrate.find_ball import Ball, find_ball
from tactograph.nodes.calibrate.find_presses import Circles
from tactograph.nodes.capture._sheet import SheetLight, cut
from tactograph.nodes.capture.read_balls import KnownCircles, Radii


class FoundBalls(NamedTuple):
    """A circle per press, and how sure each is."""

    circle: Circles
    goodness: Annotated[F4, Port("P", "1")]


@node
def find_balls(
    light: SheetLight,
    flat: Light,
    radius: Radii,
    known: KnownCircles,
    names: list[str],
    pixel: PixelSize,
) -> FoundBalls:
    """Return the contact circle of every press, as `find_ball` finds it.

    A press in which no ball is found is named in a warning and goes on with a radius of 0,
    which takes it out of everything that follows; a single press is refused instead.

    Parameters
    ----------
    light
        K x S x W, the presses relative to the film at rest.
    flat
        K x H x W; only its size is used.
    radius, known, names
        As `read_balls` gives them.
    pixel
        mm per px.

    Returns
    -------
    FoundBalls
        x, y and contact radius in px per press, pixel centres at integers; the goodness of
        each, 0 to 1.

    Raises
    ------
    InputError
        If no press shows its ball.
    """
    balls: list[Ball | None] = []
    for press, size, circle, name in zip(
        cut(light, flat.shape[1]), radius, known, names, strict=True
    ):
        x, y, contact = (None if np.isnan(value) else float(value) for value in circle)
        try:
            ball = find_ball(
                press,
                pixel,
                radius_mm=float(size),
                center_px=None if x is None or y is None else (x, y),
                contact_px=contact,
            )
        except InputError as error:
            if len(names) == 1:
                raise
            warn(
                f"press {name} is left out: {str(error).partition(':')[0]}; if there is one, say "
                "where in its capture.yaml (ball_center_px: [x, y], ball_contact_px: r)"
            )
            ball = None
        balls.append(ball)
    if not any(balls):
        raise InputError(
            f"none of {len(names)} presses shows its ball; check ball_radius_mm and pixel_size_mm"
        )
    return FoundBalls(
        np.array([(*b.center, b.contact) if b else (0, 0, 0) for b in balls], np.float32),
        np.array([b.goodness if b else 0 for b in balls], np.float32),
    )
