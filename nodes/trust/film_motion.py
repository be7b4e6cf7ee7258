"""Find how far the camera has moved since the flat frame, from the film at rest."""

import math
from typing import Annotated

import numpy as np

from tactograph.graph import Port, node
from tactograph.nodes import F4, CoarseLight
from tactograph.nodes.trust.checked_cells import MIN_LIGHT
from tactograph.nodes.trust.explained import explained
from tactograph.nodes.trust.fall_off import FallOff
from tactograph.nodes.trust.light_departure import MIN_ERROR

FilmMotion = Annotated[F4, Port("4", "1")]
"""Shift along x and y as a share of the image's width, zoom, and turn in radians; 0: none."""


def motion_size(motion: FilmMotion) -> float:
    """Return the displacement of film at the middle of a side, as a share of the image's width."""
    along, down, zoom, turn = motion.tolist()
    return math.hypot(along, down, zoom / 2, turn / 2)


def motion_in_words(motion: FilmMotion) -> str:
    """Return the parts of a motion that are above its error, in words."""
    along, down, zoom, turn = motion.tolist()
    words = []
    for share, side in (-along, "right"), (along, "left"), (-down, "down"), (down, "up"):
        if share > MIN_ERROR:
            words.append(f"{share:.1%} of the image's width further {side}")
    if abs(zoom) > MIN_ERROR:
        words.append(f"{abs(zoom):.1%} {'smaller' if zoom > 0 else 'larger'}")
    if abs(turn) > MIN_ERROR:
        words.append(f"turned by {math.degrees(abs(turn)):.1f} degrees")
    return ", ".join(words)


@node
def film_motion(light: CoarseLight, fall_off: FallOff) -> FilmMotion:
    """Return the shift, zoom and turn that explain the film at rest along the border (T7).

    They are 0 if they explain too little of its light (`explained`).

    Parameters
    ----------
    light : K x h x w on cells, relative to the flat frame, before drift is removed
    fall_off : 4 x K x h x w, from the node `fall_off`
    """
    ring = fall_off.any(axis=(0, 1))
    if not ring.any():
        return np.zeros(len(fall_off), np.float32)
    change = np.log(np.maximum(light[:, ring], MIN_LIGHT))
    return explained(change, fall_off[:, :, ring]).astype(np.float32)
