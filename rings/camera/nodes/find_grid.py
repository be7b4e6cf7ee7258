"""Find the marks of a grid that lies on the film, and their lattice coordinates.

Long because dots and checkerboards are found in different ways, and a user may lay down either.
"""

from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.rings.camera.nodes._checkerboard import find_corners
from tactograph.rings.camera.nodes._dots import find_dots
from tactograph.rings.camera.nodes._lattice import MIN_POINTS, Lattice
from tactograph.rings.camera.nodes.read_grey import GreyImage
from tactograph.sdk import F4, InputError, Port, node, warn

MAX_NAMED_DOTS = 5
"""Most dots that a message names."""


class GridMarks(NamedTuple):
    """N dots or corners: x, y in px in the image, and column, row on the lattice.

    `astray` counts whole dots that are on no place of it, and places inside it without a mark.
    """

    place: Annotated[F4, Port("N 2", "px")]
    cell: Annotated[NDArray[np.int32], Port("N 2", "lattice place")]
    pattern: str
    astray: int


@node
def find_grid(
    image: GreyImage, *, pattern: Literal["auto", "dots", "checkerboard"] = "auto"
) -> GridMarks:
    """Return the marks of a square lattice, accurate to a few hundredths of a pixel.

    Partial grids, uneven light and missing marks are allowed.  Dots cut off by the frame are
    left out; a warning names whole dots that are left out, because they are on no place of the
    lattice.

    Parameters
    ----------
    image : H x W
    pattern
        "dots": dark or bright dots.  "checkerboard": the corners where four squares meet.
        "auto": dots if any lie on a lattice, else corners.

    Returns
    -------
    N x 2 positions in px, N x 2 columns and rows of the lattice, the pattern found, and the number
    of whole dots that are not on it and of places inside it that show no whole mark.

    Raises
    ------
    InputError
        If fewer than 12 marks, or fewer than three rows or columns, lie on one lattice.
    """
    dots = find_dots(image) if pattern != "checkerboard" else None
    if dots is not None:
        if out := len(dots.astray):
            named = "; ".join(f"{x:.0f},{y:.0f}" for x, y in dots.astray[:MAX_NAMED_DOTS])
            more = f" and {out - MAX_NAMED_DOTS} more" if out > MAX_NAMED_DOTS else ""
            whole = "a whole dot is" if out == 1 else f"{out} whole dots are"
            warn(f"{whole} on no place of the grid and left out, at {named} px{more}; is it dirt?")
        return _marks(dots.lattice, "dots", out)
    corners = find_corners(image) if pattern != "dots" else None
    if corners is not None:
        return _marks(corners, "checkerboard", 0)
    marks = {"auto": "dots or corners", "dots": "dots", "checkerboard": "corners"}[pattern]
    raise InputError(
        f"the image shows no square lattice of {MIN_POINTS} {marks} or more in three rows and "
        "columns; show more of the grid, sharp, evenly lit and without glare, or name another "
        "`pattern`"
    )


def _marks(lattice: Lattice, pattern: str, astray: int) -> GridMarks:
    astray += lattice.gaps
    return GridMarks(np.asarray(lattice.place, np.float32), lattice.cell, pattern, astray)
