"""Cut a window out of images."""

from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from tactograph.sdk import InputError, Launch, Light, SizeRule, node
from tactograph.sdk.unstable import ResizedLight

Window = Annotated[tuple[int, int, int, int], "left,top,width,height"]
"""Left, top, width and height in pixels, as OpenCV's `Rect`."""


def _of_pixels(window: Window | None) -> Window | None:
    """Refuse a window that begins before the frame, or holds no pixel."""
    if window is not None and (min(window[:2]) < 0 or min(window[2:]) < 1):
        raise ValueError("[left, top, width, height] in whole pixels are needed")
    return window


def _columns(columns: int, window: Window | None) -> int:
    return columns if window is None else _inside(window[0], window[2], columns, "columns")


def _rows(rows: int, window: Window | None) -> int:
    return rows if window is None else _inside(window[1], window[3], rows, "rows")


def _inside(start: int, size: int, whole: int, unit: str) -> int:
    if start + size > whole:
        raise InputError(
            f"crop: a window of {size} {unit} from {start} on ends beyond the image's {whole}"
        )
    return size


@node(
    derived={
        "h": SizeRule("H", by="window", rule=_rows),
        "w": SizeRule("W", by="window", rule=_columns),
    }
)
def crop(
    light: Light,
    *,
    window: Annotated[
        Window | None, AfterValidator(_of_pixels), Field(examples=[(2, 1, 3, 2)])
    ] = None,
) -> ResizedLight:
    """Return a window of the images.

    A calibration is valid for the frame that it was made on: crop its images alike.

    Parameters
    ----------
    light : K x H x W
    window : ``[left, top, width, height]`` in px, as OpenCV's `Rect`; None for all of the frame

    Returns
    -------
    K x h x w, with h and w of the window.

    Raises
    ------
    InputError
        If the window ends beyond the frame.
    """
    _count, rows, columns = light.shape
    left, top = (0, 0) if window is None else window[:2]
    right, bottom = left + _columns(columns, window), top + _rows(rows, window)
    return np.ascontiguousarray(light[:, top:bottom, left:right])


@crop.opencl()
def _launch(run: Launch) -> None:
    """Copy the window."""
    left, top = (run.settings["window"] or (0, 0))[:2]
    grid = run.sizes["K"], run.sizes["h"], run.sizes["w"]
    sizes = (run.sizes["K"], run.sizes["H"], run.sizes["W"], *grid[1:])
    run.kernel("crop", grid, run.inputs["light"], run.outputs["crop"], *sizes, left, top)
