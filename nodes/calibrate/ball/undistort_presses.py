"""Undistort every press on a sheet, and the known circles of the balls."""

from typing import NamedTuple

import numpy as np

from tactograph.graph import node
from tactograph.nodes import F4, Lens, Light
from tactograph.nodes.capture.read_balls import Marks, StatedCircles
from tactograph.nodes.light.undistort import undistort
from tactograph.nodes.optics.lens import half_diagonal, ideal_offset, is_straight
from tactograph.nodes.optics.sheet import SheetLight, cut


class IdealPresses(NamedTuple):
    """P presses on the ideal grid as a sheet, the first of them alone, known circles and marks."""

    image: SheetLight
    first: Light
    circles: StatedCircles
    marks: Marks | None


@node
def undistort_presses(
    image: SheetLight, first: Light, circles: StatedCircles, lens: Lens, marks: Marks | None = None
) -> IdealPresses:
    """Return the presses of `read_balls` as a camera without distortion would see them.

    Parameters
    ----------
    image : K x S x W, a sheet of captures
    first : K x H x W, the first of them
    circles : P x 3 in px of the captured images; the radius does not change
    lens : length 8 as `read_lens` gives it, all zero for an ideal lens
    marks : M x 3, marked balls: x, y in px, press
    """
    if is_straight(lens):
        return IdealPresses(image, first, circles, marks)
    rows, columns = first.shape[1:]
    presses = [undistort(press, lens) for press in cut(image, rows)]
    circles = ideal_circles(circles, lens, (rows, columns))
    if marks is not None:
        marks = ideal_circles(marks, lens, (rows, columns))
    return IdealPresses(np.concatenate(presses, axis=1), presses[0], circles, marks)


def ideal_circles(circles: F4, lens: Lens, shape: tuple[int, int]) -> F4:
    """Return circles, P x 3 in px, with their middles where they are in the ideal image."""
    rows, columns = shape
    half = float(half_diagonal(shape))
    place = circles[:, :2] - np.array([(columns - 1) / 2, (rows - 1) / 2], np.float32)
    offset = np.stack(ideal_offset(lens, place[:, 0] / half, place[:, 1] / half), axis=1)
    circles = circles.copy()
    circles[:, :2] += half * offset
    return circles
