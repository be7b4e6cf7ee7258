"""Common parts of the shape nodes: the record that they return and the grid that they fill."""

from typing import Annotated, NamedTuple, Self

import numpy as np
from annotated_types import Interval

from tactograph.graph import InputError
from tactograph.nodes import F4, F8, Height, PixelSize

Side = Annotated[int, Interval(ge=1, le=16384)]
"""Width or height of an image in pixels."""
MAX_PIXELS = 2**24
"""Largest number of pixels of a simulated image: 17 million."""
Length = Annotated[float, Interval(gt=0, le=1e4)]
"""A length in mm, at most 10 m."""
PixelSide = Annotated[float, Interval(ge=1e-4, le=10)]
"""Side of a pixel in mm, from a tenth of a micrometre."""
Offset = tuple[float, float]
"""(x, y) in mm from the centre of the image, x right, y down."""

PAPER_PIXEL_MM = 1 / 14
"""The paper's simulation: a ball of radius 5 mm is 70 pixels high (section 4.1)."""


class ShapeImage(NamedTuple):
    """The image of a shape.

    Parameters
    ----------
    offset_mm : middle or axis of the shape from the centre of the image
    width_px, height_px, pixel_size_mm : size of the image, and of its pixels
    """

    offset_mm: Offset = (0.0, 0.0)
    width_px: Side = 320
    height_px: Side = 240
    pixel_size_mm: PixelSide = PAPER_PIXEL_MM

    def places(self, angle_deg: float | None = None) -> tuple[F8, F8]:
        """Return x and y of the pixel centres in mm from the shape's middle.

        With an angle they are in axes rotated by it from x towards y, H x W each; without it they
        are 1 x W and H x 1.

        Raises
        ------
        InputError
            If the image has more than `MAX_PIXELS`.
        """
        self.check_pixels()
        sides = zip((self.width_px, self.height_px), self.offset_mm, strict=True)
        x, y = ((np.arange(n) - (n - 1) / 2) * self.pixel_size_mm - middle for n, middle in sides)
        x, y = x.astype(np.float64)[None, :], y.astype(np.float64)[:, None]
        if angle_deg is None:
            return x, y
        angle = np.deg2rad(angle_deg)
        c, s = float(np.cos(angle)), float(np.sin(angle))
        return np.asarray(c * x + s * y, np.float64), np.asarray(c * y - s * x, np.float64)

    def check_pixels(self) -> None:
        """Refuse an image of more than `MAX_PIXELS`."""
        pixels = self.width_px * self.height_px
        if pixels > MAX_PIXELS:
            raise InputError(
                f"`width_px`={self.width_px} and `height_px`={self.height_px} are "
                f"{pixels / 1e6:.0f} million pixels; simulate at most "
                f"{MAX_PIXELS / 1e6:.0f} million"
            )


class Shape(NamedTuple):
    """A surface as the camera sees it."""

    height: Height
    pixel_size: PixelSize

    @classmethod
    def of(cls, height: F8, pixel_size_mm: float) -> Self:
        """Return the record of a height in mm, clipped at the film at rest."""
        top: F4 = np.asarray(np.maximum(height, 0.0), np.float32)
        return cls(top, float(pixel_size_mm))
