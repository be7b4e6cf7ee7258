"""Bin the pixels of large images to the resolution that a calibration needs."""

from typing import Annotated, NamedTuple

import numpy as np

from tactograph.graph import Port, node
from tactograph.nodes import F4, CoarseDark, CoarseLight, Dark, Light, PixelSize
from tactograph.nodes.capture.read_balls import Marks, Radii, StatedCircles
from tactograph.nodes.optics.block_sums import whole_cells
from tactograph.nodes.optics.sheet import SheetLight, cut

MIN_BALL_RADIUS_PX = 16.0
"""Smallest radius of a ball in px after binning."""
MIN_IMAGE_PIXELS = 3e5
"""Fewest pixels of an image after binning."""


class BinnedPresses(NamedTuple):
    """Binned presses on a sheet, the binned film at rest, the known circles, and n."""

    image: Annotated[F4, Port("K s w", "1")]
    flat: CoarseLight
    dark: CoarseDark
    circles: StatedCircles
    pixel: PixelSize
    factor: int
    marks: Marks | None = None


@node
def bin_presses(
    image: SheetLight,
    flat: Light,
    dark: Dark,
    pixel: PixelSize,
    radius: Radii | None = None,
    circles: StatedCircles | None = None,
    marks: Marks | None = None,
) -> BinnedPresses:
    """Bin all inputs of a calibration by n x n pixels.

    A film model needs no more than a ball of 16 px radius and an image of 300,000 pixels.
    Images up to 640 x 480 do not change.  Rows and columns that do not fill a bin at the end
    are left out, which moves the middle of the image by less than a (binned) pixel.

    Parameters
    ----------
    image : K x S x W, the presses as captured, on a sheet (`sheet`)
    flat, dark : K x H x W and H x W
    pixel : mm per px as captured
    radius, circles
        The balls: P in mm, and P x 3 in px.  Without them nothing is binned.
    marks : M x 3, marked balls: x, y in px, press
    """
    if radius is None or circles is None:
        return BinnedPresses(image, flat, dark, np.zeros((0, 3), np.float32), pixel, 1)
    rows, columns = dark.shape
    by_ball = float(radius.min()) / pixel / MIN_BALL_RADIUS_PX
    factor = int(min(by_ball, np.sqrt(rows * columns / MIN_IMAGE_PIXELS)))
    if factor <= 1:
        return BinnedPresses(image, flat, dark, circles, pixel, 1, marks)
    presses = [whole_cells(press, factor) for press in cut(image, rows)]
    scaled = circles.copy()
    scaled[:, :2] = (circles[:, :2] + 0.5) / factor - 0.5
    scaled[:, 2] = circles[:, 2] / factor
    if marks is not None:
        marks = np.column_stack([(marks[:, :2] + 0.5) / factor - 0.5, marks[:, 2]])
    return BinnedPresses(
        np.concatenate(presses, axis=1),
        whole_cells(flat, factor),
        whole_cells(dark[None], factor)[0],
        scaled,
        pixel * factor,
        factor,
        None if marks is None else marks.astype(np.float32),
    )
