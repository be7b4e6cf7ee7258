"""Detect presses that were taken under other light than the flat frame."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError, node
from tactograph.nodes import F4, Light
from tactograph.nodes.calibrate import BallCircles, BallPress
from tactograph.nodes.calibrate.lights.light_samples import is_uniform
from tactograph.nodes.calibrate.lights.other_press import (
    CELL_PX,
    far_cells,
    film_beside,
    other_press,
)
from tactograph.nodes.calibrate.rating.verdict import Judged
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.optics.sheet import SheetLight, cut
from tactograph.nodes.trust.banded_rows import BANDS_WARNING, is_banded
from tactograph.nodes.trust.explained import added_share
from tactograph.nodes.trust.fall_off import fall_off
from tactograph.nodes.trust.film_motion import film_motion, motion_in_words, motion_size

MAX_DEPARTURE = 0.08
"""Departure of an LED's light up to which pressed film and flickering LEDs explain it."""
MAX_ADDED = 0.03
"""Largest added light (T3) relative to the film at rest."""
MAX_MOTION = 0.02
"""Largest motion of the film between flat frame and press, over the image's width (T7)."""
NO_FILM_LIGHT = 0.1
"""Light beside the balls, under all LEDs, below which there is no film."""
_TAKEN_FLAT = (
    "the flat frame",
    "take both with one sensor and the same exposure, gain, gamma and LED currents, none of them "
    "automatic",
)
_MODELLED_FLAT = (
    "a plain film under the LEDs that were found, as no flat frame was given",
    "give one, `folder`=DIR",
)
_VENDORS_FLAT = (
    "level film by the light model `start`",
    "is it this sensor's, with the same exposure? Else give the untouched film, `folder`=DIR",
)
"""The frame that a press is compared with, and the advice."""


@node
def rate_exposure(
    light: SheetLight,
    flat: Light,
    taken: Light,
    circle: BallCircles,
    of: BallPress,
    names: list[str],
    *,
    start: Path | None = None,
    folder: Path | None = None,
) -> Judged:
    """Compare the untouched film of the presses with the flat frame, and doubt a large difference.

    Heights follow from light relative to the flat frame, so exposure, gain, gamma, LED currents and
    the camera's position have to be the same in both.  The film beyond the balls' skirts shows
    whether they are.

    Parameters
    ----------
    light : K x S x W, the presses relative to the film at rest, on a sheet (`sheet`)
    flat : K x H x W, the film at rest
    taken : K x H x W, the flat frame before `rest_light`; uniform if none was taken
    circle, of
        The balls: x, y and contact radius in px of their press, B x 3, and the number of that
        press, B.
    names : the presses' names
    start, folder
        The light model that gives the film at rest if there is no capture of it; and the capture.

    Returns
    -------
    ``rest_departure_percent``, the largest of all presses and LEDs, with its sign; a doubt for each
    press that is mirrored, turned, exchanged or moved relative to the flat frame, that flickers, or
    that differs by more than pressed film and flickering LEDs explain.

    Raises
    ------
    InputError
        If there is no film beside a ball.
    """
    presses = cut(light, flat.shape[1])
    compared, cure = _MODELLED_FLAT if is_uniform(taken) else _TAKEN_FLAT
    if start is not None and folder is None:
        compared, cure = _VENDORS_FLAT
    worst, doubts, due = 0.0, [], coarsen(flat, factor=CELL_PX)
    for number, press in enumerate(presses):
        # A single press has no name.
        where = f"{names[number]}: " if names[number] else ""
        cells = coarsen(press, factor=CELL_PX)
        motion = film_motion(cells, fall_off(due), due)
        moved = motion_in_words(motion) if motion_size(motion) > MAX_MOTION else ""
        if not moved and is_banded(cells):
            doubts.append(where + BANDS_WARNING)
            continue
        free = film_beside(press, circle[of == number])
        far = far_cells(free)
        if other := other_press(cells, due, far):
            doubts.append(where + other)
            continue
        which, level = _departure(press, free, where)
        worst = max(worst, level, key=abs)
        if abs(level) > MAX_DEPARTURE:
            more = f"{abs(level):.0%} {'brighter' if level > 0 else 'darker'}"
            doubts.append(
                f"{where}under {which} the film beside the ball is {more} than {compared}: {cure}"
            )
            continue
        added = added_share(cells[:, far], due[:, far])
        if doubt := _of_motion_or_light(moved, added, compared):
            doubts.append(where + doubt)
    return Judged({"rest_departure_percent": 100 * worst}, doubts)


def _of_motion_or_light(moved: str, added: float, compared: str) -> str:
    """A doubt if the film has moved, in words, or has added light; both look alike.

    Added light evens out the film's fall-off, as a zoom does.
    """
    lies = (
        f"beside the ball the film does not lie where the flat frame shows it: {moved} (take "
        "both with the same camera, lens, zoom and crop)"
    )
    is_lit = (
        f"under all LEDs the film beside the ball is {abs(added):.1%} "
        f"{'brighter' if added > 0 else 'darker'} than {compared}, the dimmer the more: keep "
        "other light out, or take an image with all LEDs off as well"
    )
    if abs(added) <= MAX_ADDED:
        return lies if moved else ""
    if moved and added < 0:  # other light brightens, unless only the flat frame had it
        return f"{lies}, or {is_lit}"
    return f"{is_lit}; or is it another zoom or crop?"


def _departure(press: F4, free: NDArray[np.bool_], where: str) -> tuple[str, float]:
    """Return the LED that departs most, or "all LEDs", and its light on film at rest minus 1."""
    levels = np.median(press[:, free], axis=1) - 1
    if (levels < NO_FILM_LIGHT - 1).all():
        raise InputError(
            f"{where}there is no film beside the ball: press the ball into the film, since slopes "
            "and heights are measured relative to the light of the film at rest"
        )
    led = int(np.argmax(np.abs(levels)))
    level = float(levels[led])
    is_of_all = (levels * np.sign(level) > MAX_DEPARTURE).all()
    return "all LEDs" if is_of_all else f"LED {led + 1}", level
