"""Tell whether a press's images are in another order than the flat frame's, or of the same LED."""

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.trust.other_frame import other_frame

SKIRT_RADII = 1.5
"""Radius of the skirt in contact radii; film within it is lifted, and darkened by its slope."""
MIN_FREE_SHARE = 0.05
"""Share of the frame that has to lie outside the skirts; otherwise the whole frame counts."""
CELL_PX = 4
"""Side of the cells on which a press is compared with the flat frame, in px."""
MIN_ANGLE_DEG = 5.0
"""Angle between two LEDs below which they count as the same LED."""
MIN_COMPARED_CELLS = 8
"""Least cells of a contact that are correlated: chance then gives the cosine of the smallest angle
to any two of eight LEDs in one of 100,000 contacts."""


def film_beside(press: F4, circles: F4) -> NDArray[np.bool_]:
    """Return the pixels that are film at rest; all pixels if the balls leave too few."""
    rows, columns = press.shape[1:]
    y, x = np.mgrid[:rows, :columns]
    free = np.ones((rows, columns), bool)
    for at_x, at_y, radius in circles:
        free &= (x - at_x) ** 2 + (y - at_y) ** 2 > (SKIRT_RADII * radius) ** 2
    return free if free.mean() >= MIN_FREE_SHARE else np.ones_like(free)


def far_cells(free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the cells that are film at rest all over."""
    return coarsen(free[None].astype(np.float32), factor=CELL_PX)[0] == 1


def other_press(light: F4, due: F4, far: NDArray[np.bool_]) -> str:
    """Return what was done to the images of a press, in a sentence; "" if nothing explains it.

    On cells: its light relative to the film at rest, `due`, and where it shows that (`far_cells`).
    """
    other = other_frame(light * due, due, far)
    return other and (
        f"beside the ball the images show the film of the flat frame {other}: take press and flat "
        "frame in the same way"
    )


def same_press(image: F4, contact: NDArray[np.bool_]) -> str:
    """Return which two images of a press show one and the same light, in a sentence; "" if none.

    On cells: the images as captured, and where they show the ball.  Under LEDs in two directions a
    slope brightens one image and darkens the other, so they correlate by about the cosine of the
    angle between these.
    """
    if np.count_nonzero(contact) < MIN_COMPARED_CELLS:
        return ""
    alike = np.corrcoef(image[:, contact]) > np.cos(np.radians(MIN_ANGLE_DEG))
    for one, other in np.argwhere(np.triu(alike, 1))[:1] + 1:
        return (
            f"the images of LED {one} and LED {other} show the ball in the same light (is "
            f"led{other} a copy of led{one}, does one LED flash twice, or do all shine at once?)"
        )
    return ""
