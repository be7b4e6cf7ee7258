"""Undistort every press on a sheet, and the known circles of the balls."""

from typing import NamedTuple

import numpy as np

from tactograph.graph import node
from tactograph.nodes import Lens, Light
from tactograph.nodes.capture.read_balls import Marks, StatedCircles
from tactograph.nodes.light.undistort import undistort
from tactograph.nodes.optics.camera_view import View
from tactograph.nodes.optics.lens import is_straight
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
    circles = View(lens).ideal_circles((rows, columns), circles)
    if marks is not None:
        marks = View(lens).ideal_circles((rows, columns), marks)
    return IdealPresses(np.concatenate(presses, axis=1), presses[0], circles, marks)
