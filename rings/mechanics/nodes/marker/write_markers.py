"""Write the shifts of a film's markers, as a table and as arrows."""

from pathlib import Path

import cv2
import numpy as np

from tactograph.sdk import Arrows, ImageFile, InputError, Touch, atomic_files, node

MARKER_COLUMNS = "x_px,y_px,dx_px,dy_px,x_mm,y_mm,dx_mm,dy_mm,visible"
MIN_WIDTH_PX = 640
"""Smallest width of the picture."""


@node
def write_markers(touch: Touch, *, folder: Path) -> None:
    """Write ``markers.csv`` and ``markers.png``.

    One row per marker: its place on the untouched film and its shift, in px and in mm (places in
    mm from the middle of the image), and whether it was seen (1) or predicted from its
    neighbours (0).

    Parameters
    ----------
    touch
        As `join_touch` makes it, with `markers`; the mean of its image is the background of the
        picture.
    folder : created if needed

    Raises
    ------
    InputError
        If the folder cannot be written, or the touch has no markers.
    """
    if "markers" not in touch.layers:
        raise InputError("write_markers: the touch has no markers; give join_touch its 'markers'")
    tracks, image, pixel = touch.layers["markers"], touch.image, touch.pixel
    markers, shift, visible = tracks
    rows, columns = image.shape[1:]
    place = markers[:, :2]
    away = (place - np.array([(columns - 1) / 2, (rows - 1) / 2], np.float32)) * pixel
    table = np.column_stack([place, shift, away, shift * pixel, visible])
    scale = -(-MIN_WIDTH_PX // columns)
    grey = (255 * image.mean(axis=0).clip(0, 1)).astype(np.uint8)
    large = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR)
    picture = np.asarray(cv2.cvtColor(large, cv2.COLOR_GRAY2RGB), np.uint8)
    Arrows(markers[:, :2], shift, visible).draw(picture, scale)
    with atomic_files(folder / touch.name if touch.name else folder) as target:
        formats = ["%.3f"] * 4 + ["%.4f"] * 4 + ["%d"]
        np.savetxt(target / "markers.csv", table, formats, ",", header=MARKER_COLUMNS, comments="")
        ImageFile(target / "markers.png").write(picture[..., ::-1])
