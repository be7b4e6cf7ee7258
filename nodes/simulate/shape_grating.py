"""A patch of parallel ridges."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval

from tactograph.graph import node
from tactograph.nodes import F8
from tactograph.nodes.optics.shape import (
    PAPER_PIXEL_MM,
    Length,
    Offset,
    PixelSide,
    Shape,
    Side,
    grid,
    shape,
    turned,
)

Profile = Literal["square", "triangle", "sine"]


@node
def shape_grating(
    *,
    period_mm: Length = 2.0,
    rise_mm: Length = 0.5,
    profile: Profile = "square",
    duty: Annotated[float, Interval(gt=0, lt=1)] = 0.5,
    side_mm: Length = 12.0,
    angle_deg: float = 0.0,
    offset_mm: Offset = (0.0, 0.0),
    width_px: Side = 320,
    height_px: Side = 240,
    pixel_size_mm: PixelSide = PAPER_PIXEL_MM,
) -> Shape:
    """Return the height of a grating, to test resolution and ridges that shade grooves.

    Parameters
    ----------
    period_mm
        From ridge to ridge.
    rise_mm
        Height of the ridges; the grooves reach down to the plane.
    profile
        Cross-section of a ridge.
    duty
        Share of a period that the ridge takes; the rest is flat groove.
    side_mm
        Side of the square patch that the grating fills.
    angle_deg
        Azimuth across the ridges, from x (right) towards y (down).
    offset_mm
        Centre of the patch, the middle of a ridge, from the centre of the image.
    width_px, height_px, pixel_size_mm
        The image.

    Returns
    -------
    Height H x W, mm, and the pixel size.
    """
    x, y = grid(width_px, height_px, pixel_size_mm, offset_mm)
    across, along = turned(x, y, angle_deg)
    phase = np.abs(across / period_mm - np.round(across / period_mm))
    height = rise_mm * _ridge(phase / (duty / 2), profile)
    there = np.maximum(np.abs(across), np.abs(along)) <= side_mm / 2
    return shape(np.where(there, height, 0.0), pixel_size_mm)


def _ridge(from_middle: F8, profile: Profile) -> F8:
    """Height 0 to 1 of a ridge; `from_middle` is 0 in its middle and 1 at its foot."""
    t = np.minimum(from_middle, 1.0)
    if profile == "square":
        return np.where(from_middle < 1, 1.0, 0.0)
    if profile == "triangle":
        return np.asarray(1 - t)
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * t))
