"""Common parts of the shape nodes: the record they return and the grid they fill."""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from tactograph.graph import InputError
from tactograph.nodes import F4, F8, Height, PixelSize

Side = Annotated[int, Interval(ge=1, le=16384)]
"""Width or height of an image in pixels."""
MAX_PIXELS = 2**24
"""Most pixels of a simulated image: 17 million."""
Length = Annotated[float, Interval(gt=0, le=1e4)]
"""A length in mm, at most 10 m."""
WallAngle = Annotated[float, Interval(gt=0, le=90)]
"""Angle of a wall against the plane, in degrees; 90 is vertical."""
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

    def places(self) -> tuple[F8, F8]:
        """Return x (1 x W) and y (H x 1) of the pixel centres, mm from the shape's middle.

        Raises
        ------
        InputError
            If the image has more than `MAX_PIXELS`.
        """
        self.check_pixels()
        sides = zip((self.width_px, self.height_px), self.offset_mm, strict=True)
        x, y = ((np.arange(n) - (n - 1) / 2) * self.pixel_size_mm - middle for n, middle in sides)
        return np.asarray(x[None, :], float), np.asarray(y[:, None], float)

    def check_pixels(self) -> None:
        """Refuse an image that is larger than any camera's."""
        pixels = self.width_px * self.height_px
        if pixels > MAX_PIXELS:
            raise InputError(
                f"`width_px`={self.width_px} and `height_px`={self.height_px} are "
                f"{pixels / 1e6:.0f} million pixels, at most "
                f"{MAX_PIXELS / 1e6:.0f} million can be simulated"
            )


class Shape(NamedTuple):
    """A surface as the camera sees it."""

    height: Height
    pixel_size: PixelSize


def turned(x: F8, y: F8, angle_deg: float) -> tuple[F8, F8]:
    """Return the coordinates in a frame rotated by an angle from x towards y."""
    angle = np.deg2rad(angle_deg)
    c, s = np.cos(angle), np.sin(angle)
    return c * x + s * y, c * y - s * x


def shape(height: F8, pixel_size_mm: float) -> Shape:
    """Return the record of a height in mm, clipped at the film at rest."""
    top: F4 = np.asarray(np.maximum(height, 0.0), np.float32)
    return Shape(top, float(pixel_size_mm))


def risen(within: F8, rise_mm: float, wall_deg: float) -> F8:
    """Return the height of a wall, by the distance from its middle: half of `rise_mm` at 0."""
    run = rise_mm / np.tan(np.radians(wall_deg))
    return np.asarray(rise_mm * np.clip(within / max(run, 1e-9) + 0.5, 0, 1))


def stretched(height: F8, rise_mm: float | None) -> F8:
    """Return heights scaled so that the highest is `rise_mm`; None keeps them."""
    top = float(height.max(initial=0.0))
    return height if rise_mm is None or top <= 0 else height * (rise_mm / top)
