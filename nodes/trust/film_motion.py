"""How far the camera has moved since the flat frame was taken, by the film at rest."""

import math
from typing import Annotated

import numpy as np

from tactograph.graph import Port, node
from tactograph.nodes import F4, CoarseLight
from tactograph.nodes.trust.added_light import MIN_EXPLAINED, calm_weight
from tactograph.nodes.trust.fall_off import DARK_LIGHT, FallOff
from tactograph.nodes.trust.light_departure import MIN_ERROR

FIT_ROUNDS = 5
"""Rounds of robust least squares: film that is touched drops out in the first ones."""
MIN_TOLD = 0.01
"""Share of the width, zoom or turn from which on it is worth a word."""
FilmMotion = Annotated[F4, Port("4", "1")]
"""Shift along x and y as a share of the image's width, zoom, and turn in radians; 0: none."""


def motion_size(motion: FilmMotion) -> float:
    """Return by how much film is displaced in the middle of a side, over the image's width."""
    along, down, zoom, turn = motion.tolist()
    return math.hypot(along, down, zoom / 2, turn / 2)


def motion_in_words(motion: FilmMotion) -> str:
    """Return the parts of a motion that displace film by a hundredth of the width, in words."""
    along, down, zoom, turn = motion.tolist()
    told = []
    for share, side in (-along, "right"), (along, "left"), (-down, "down"), (down, "up"):
        if share >= MIN_TOLD:
            told.append(f"{share:.0%} of the image's width further {side}")
    if abs(zoom) >= MIN_TOLD:
        told.append(f"{abs(zoom):.0%} {'smaller' if zoom > 0 else 'larger'}")
    if abs(turn) >= MIN_TOLD:
        told.append(f"turned by {math.degrees(abs(turn)):.0f} degrees")
    return ", ".join(told)


@node
def film_motion(light: CoarseLight, fall_off: FallOff) -> FilmMotion:
    """Return the shift, zoom and turn that explain the film at rest along the border (T7).

    They are the least-squares solution, regularised by the error of the light, and 0 if they
    explain less than 0.7 of the changes of the light beside each LED's gain.

    Parameters
    ----------
    light : K x h x w on cells, relative to the flat frame, before any drift is taken out
    fall_off : 4 x K x h x w, as the node `fall_off` gives it
    """
    ring = fall_off.any(axis=(0, 1))
    if not ring.any():
        return np.zeros(len(fall_off), np.float32)
    change = np.log(np.maximum(light[:, ring], DARK_LIGHT))
    known = np.concatenate([fall_off[:, :, ring], change[None]]).astype(np.float64)
    count = len(fall_off)
    ridge = MIN_ERROR**2 * change.size * np.eye(count)
    weight = np.ones(change.shape[1])
    for _ in range(FIT_ROUNDS):
        # An LED's gain is its weighted mean.
        even = known - (known @ (weight / weight.sum()))[..., None]
        rows = even.reshape(count + 1, -1)
        square = (even * weight).reshape(count + 1, -1) @ rows.T
        motion = np.linalg.solve(square[:count, :count] + ridge, square[:count, count])
        left = np.square(rows[count] - motion @ rows[:count]).reshape(change.shape).mean(axis=0)
        weight = calm_weight(left)
    shown = np.square(even[count]).mean(axis=0)
    if left @ weight >= (1 - MIN_EXPLAINED) * (shown @ weight):
        return np.zeros(count, np.float32)
    return motion.astype(np.float32)
