"""The untouched film."""

import numpy as np

from tactograph.graph import node
from tactograph.nodes.optics.shape import PAPER_PIXEL_MM, PixelSide, Shape, ShapeImage, Side


@node
def shape_flat(
    *, width_px: Side = 320, height_px: Side = 240, pixel_size_mm: PixelSide = PAPER_PIXEL_MM
) -> Shape:
    """Return a film that nothing touches, H x W of zeros in mm: the flat frame of a calibration.

    Parameters
    ----------
    width_px, height_px, pixel_size_mm : size of the image, and of its pixels
    """
    ShapeImage(width_px=width_px, height_px=height_px).check_pixels()
    return Shape.of(np.zeros((height_px, width_px)), pixel_size_mm)
