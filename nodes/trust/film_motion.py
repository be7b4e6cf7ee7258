"""Find how far the camera has moved since the flat frame, from the film at rest.

Added light changes that film in a similar way, so it is found together with the motion.
"""

import math
from typing import Annotated

import numpy as np

from tactograph.graph import Port, node
from tactograph.nodes import F4, CoarseLight
from tactograph.nodes.trust.checked_cells import MIN_LIGHT
from tactograph.nodes.trust.explained import added_share, explained
from tactograph.nodes.trust.fall_off import FallOff
from tactograph.nodes.trust.light_departure import MIN_ERROR

FilmMotion = Annotated[F4, Port("5", "1")]
"""Shift along x and y as a share of the image's width, zoom, turn in radians, and light that was
added, over that of the film; 0: none."""


def motion_size(motion: FilmMotion) -> float:
    """Return the displacement of film at the middle of a side, as a share of the image's width."""
    along, down, zoom, turn, *_ = motion.tolist()
    return math.hypot(along, down, zoom / 2, turn / 2)


def motion_in_words(motion: FilmMotion) -> str:
    """Return the parts of a motion that are above its error, in words."""
    along, down, zoom, turn, *_ = motion.tolist()
    sides = (-along, "right"), (along, "left"), (-down, "down"), (down, "up")
    parts = [(size, f"{size:.1%} of the image's width further {side}") for size, side in sides]
    parts.append((abs(zoom), f"{abs(zoom):.1%} {'smaller' if zoom > 0 else 'larger'}"))
    parts.append((abs(turn), f"turned by {math.degrees(abs(turn)):.1f} degrees"))
    return ", ".join(words for size, words in parts if size > MIN_ERROR)


def change_in_words(motion: FilmMotion) -> str:
    """Return a sentence about the film: how it lies, and what light was added."""
    moved, added = motion_in_words(motion), motion.item(4)
    sense, source = (
        ("brighter", "other light, or a higher black level")
        if added > 0
        else ("darker", "a lower black level, or other light that has gone")
    )
    lit = f"all LEDs together are {sense} by {abs(added):.1%}, most where film is dim"
    if not moved:
        return (
            f"on the film at rest {lit}: is it {source}, a gamma, or another zoom or crop? (keep "
            "other light out, or calibrate under it and with a dark image of it; put black level, "
            "gamma, zoom and crop back as they were)"
        )
    cure = "put camera, lens, zoom and crop back as they were for the calibration"
    return (
        f"the film at rest does not lie where the flat frame shows it: {moved} ({cure}, or "
        f"calibrate again)" + (f"; or is it {source}? {lit[0].upper()}{lit[1:]}" if added else "")
    )


@node
def film_motion(light: CoarseLight, fall_off: FallOff, flat: CoarseLight) -> FilmMotion:
    """Return the camera motion and the added light that explain the film's border at rest (T7).

    The motion is a shift, a zoom and a turn; the light is added everywhere (`added_share`).  Motion
    and light are 0 if they explain too little (`explained`).  Added light flattens the film's
    fall-off, as a zoom does, so that one may be mistaken for the other.

    Parameters
    ----------
    light : K x h x w on cells, relative to the flat frame, before drift is removed
    fall_off : 4 x K x h x w, from the node `fall_off`
    flat : K x h x w, the film at rest on the same cells
    """
    motion, ring = np.zeros(len(fall_off) + 1, np.float32), fall_off.any(axis=(0, 1))
    if ring.any():
        border = light[:, ring]
        motion[:4] = explained(np.log(np.maximum(border, MIN_LIGHT)), fall_off[:, :, ring])
        motion[4] = added_share(border, flat[:, ring])
    return motion
