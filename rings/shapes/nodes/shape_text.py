"""Raised letters."""

from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge

from tactograph.sdk import F8, ImageFile, InputError, Length, Shape, ShapeImage, node

LETTER_SUBSAMPLES = 4
"""Letters are drawn this many times finer than the image, so that their outline is smooth."""


@node
def shape_text(
    *,
    text: str = "TOUCH",
    size_mm: Length = 5.0,
    rise_mm: Length = 1.0,
    bevel_mm: Annotated[float, Ge(0)] = 0.3,
    angle_deg: float = 0.0,
    image: ShapeImage,
) -> Shape:
    r"""Return the height of raised letters, in the bold font that Matplotlib includes.

    Parameters
    ----------
    text : the text; ``\n`` begins a new line
    size_mm : font size: the distance from line to line
    rise_mm : height of the letters' flat tops
    bevel_mm : width of the slope from a letter's outline to its top; 0 for vertical walls
    angle_deg : turns the text from x (right) towards y (down)

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    depth, left, top = _depth_inside(text, size_mm, image.pixel_size_mm / LETTER_SUBSAMPLES)
    x, y = image.places(angle_deg)
    scale = LETTER_SUBSAMPLES / image.pixel_size_mm
    columns = np.asarray((x - left) * scale - 0.5, np.float32)
    rows = np.asarray((y - top) * scale - 0.5, np.float32)
    columns, rows = np.broadcast_arrays(columns, rows)
    inside = cv2.remap(depth, columns.copy(), rows.copy(), cv2.INTER_LINEAR)
    # Half a fine pixel is the outline itself.
    slope = max(bevel_mm, image.pixel_size_mm / LETTER_SUBSAMPLES)
    return Shape.of(rise_mm * np.clip(inside / slope, 0.0, 1.0).astype(float), image.pixel_size_mm)


def _depth_inside(text: str, size_mm: float, cell_mm: float) -> tuple[np.ndarray, float, float]:
    """Return the distance to the nearest outline, mm, and the picture's left and top edge."""
    outlines = _outlines(text, size_mm)
    points = np.concatenate(outlines) if outlines else np.empty((0, 2))
    if len(points) == 0:
        raise InputError(f"`text`={text!r} has nothing to draw; give some letters")
    low, high = points.min(0) - 2 * cell_mm, points.max(0) + 2 * cell_mm
    middle = (low + high) / 2
    columns, rows = np.ceil((high - low) / cell_mm).astype(int)
    if columns * rows > ImageFile.MAX_PIXELS:
        raise InputError(
            f"`size_mm`={size_mm:g} draws the text on {columns} x {rows} fine pixels; "
            "make the letters smaller or the pixels larger"
        )
    picture = np.zeros((rows, columns), np.uint8)
    # Coordinates with 4 fractional bits; even-odd filling leaves the holes of letters open.
    cells = [np.rint(((o - low) / cell_mm - 0.5) * 16).astype(np.int32) for o in outlines]
    cv2.fillPoly(picture, cells, 255, shift=4)
    distance = cv2.distanceTransform(picture, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    left, top = low - middle
    return distance * np.float32(cell_mm), float(left), float(top)


def _outlines(text: str, size_mm: float) -> list[F8]:
    """Closed outlines of the letters, y down, mm."""
    # Matplotlib takes long to load; only this node needs its fonts.
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    font = FontProperties(family="DejaVu Sans", weight="bold")
    outlines: list[F8] = []
    for line, words in enumerate(text.split("\n")):
        if not words.strip():
            continue  # Matplotlib fails on a path of nothing.
        path = TextPath((0, 0), words, size=size_mm * 16, prop=font)
        for polygon in path.to_polygons():
            points = np.asarray(polygon, np.float64) / 16
            outlines.append(points * (1, -1) + (0, line * size_mm))
    return outlines
