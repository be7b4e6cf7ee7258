"""Find the marks of a grid that lies on the film, and their lattice coordinates."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal, NamedTuple

import numpy as np

from tactograph.graph import InputError, Port, node
from tactograph.nodes import F4, I4
from tactograph.nodes.calibrate._checkerboard import find_corners
from tactograph.nodes.calibrate._dots import find_dots
from tactograph.nodes.calibrate._lattice import FEWEST, Lattice
from tactograph.nodes.capture.read_grey import GreyImage


class GridMarks(NamedTuple):
    """N dots or corners: x, y in px in the image, and column, row on the lattice."""

    place: Annotated[F4, Port("N 2", "px")]
    cell: Annotated[I4, Port("N 2", "lattice place")]
    pattern: str


@node
def find_grid(
    image: GreyImage, *, pattern: Literal["auto", "dots", "checkerboard"] = "auto"
) -> GridMarks:
    """Return the marks of a square lattice, accurate to a few hundredths of a pixel.

    Partial grids, uneven light and missing marks are allowed.  Dots cut off by the frame are
    left out.

    Parameters
    ----------
    image
        H x W.
    pattern
        "dots": dark or bright dots.  "checkerboard": the corners where four squares meet.
        "auto": dots if any lie on a lattice, else corners.

    Returns
    -------
    GridMarks
        N x 2 positions in px, N x 2 columns and rows of the lattice, and the pattern found.

    Raises
    ------
    InputError
        If fewer than 12 marks, or fewer than three rows or columns, lie on one lattice.
    """
    for name, found in _tried(image, pattern):
        if found is not None:
            return GridMarks(np.asarray(found.place, np.float32), found.cell, name)
    what = {"auto": "dots or corners", "dots": "dots", "checkerboard": "corners"}[pattern]
    raise InputError(
        f"the image shows no square lattice of {FEWEST} {what} or more in three rows and columns; "
        "show more of the grid, sharp, evenly lit and without glare, or name another pattern="
    )


def _tried(image: GreyImage, pattern: str) -> Iterator[tuple[str, Lattice | None]]:
    if pattern != "checkerboard":
        yield "dots", find_dots(image)
    if pattern != "dots":
        yield "checkerboard", find_corners(image)
