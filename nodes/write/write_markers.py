"""Write the shifts of a film's markers, as a table and as arrows."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from tactograph.graph import node
from tactograph.graph.disk.atomic_files import atomic_files
from tactograph.nodes import Light, PixelSize
from tactograph.nodes.drawing.arrows import draw_arrows
from tactograph.nodes.files.image_files import write_image
from tactograph.nodes.marker.find_markers import Markers
from tactograph.nodes.marker.track_markers import Seen, Shifts

HEAD = "x_px,y_px,dx_px,dy_px,x_mm,y_mm,dx_mm,dy_mm,seen"
LEAST_WIDTH = 640
"""Smallest width of the picture in pixels."""


@node
def write_markers(
    markers: Markers,
    shift: Shifts,
    seen: Seen,
    image: Light,
    pixel: PixelSize,
    name: str,
    *,
    folder: Path,
) -> None:
    """Write ``markers.csv`` and ``markers.png``.

    One row per marker: its place on the untouched film and its shift, in px and in mm (places in
    mm from the middle of the image), and whether it was seen (1) or predicted from its
    neighbours (0).

    Parameters
    ----------
    markers
        M x 3 in px, as `find_markers` gives them.
    shift, seen
        M x 2 in px, and M, as `track_markers` gives them.
    image
        K x H x W of the touch; its mean is the background of the picture.
    pixel
        mm per px.
    name
        The capture's name in a stream; empty for a single capture.
    folder
        Created if needed.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    rows, columns = image.shape[1:]
    place = markers[:, :2]
    away = (place - np.array([(columns - 1) / 2, (rows - 1) / 2], np.float32)) * pixel
    table = np.column_stack([place, shift, away, shift * pixel, seen])
    scale = -(-LEAST_WIDTH // columns)
    grey = (255 * image.mean(axis=0).clip(0, 1)).astype(np.uint8)
    large = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR)
    picture = np.asarray(cv2.cvtColor(large, cv2.COLOR_GRAY2RGB), np.uint8)
    draw_arrows(picture, place, shift, seen, scale)
    with atomic_files(folder / name if name else folder) as target:
        formats = ["%.3f"] * 4 + ["%.4f"] * 4 + ["%d"]
        np.savetxt(target / "markers.csv", table, formats, ",", header=HEAD, comments="")
        write_image(target / "markers.png", picture[..., ::-1])
