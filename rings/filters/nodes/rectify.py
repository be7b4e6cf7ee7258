"""Resample a rectangle that a camera sees at an angle to a regular grid."""

from typing import Annotated

import cv2
import numpy as np
from annotated_types import Interval
from pydantic import AfterValidator

from tactograph.sdk import F4, Close, Launch, Light, PixelSize, node
from tactograph.sdk.unstable import between_pixels

Corner = tuple[float, float]
Corners = tuple[Corner, Corner, Corner, Corner]
Millimetres = Annotated[float, Interval(gt=0, le=1000)]
MIN_DEPTH = np.float32(1e-3)
"""Smallest divisor of the homography: nothing lies behind the camera."""


def _clockwise(corners: Corners | None) -> Corners | None:
    """Refuse corners that no rectangle can have in an image: all must turn the same way."""
    if corners is not None:
        sides = np.roll(corners, -1, axis=0) - np.asarray(corners)
        after = np.roll(sides, -1, axis=0)
        if (sides[:, 0] * after[:, 1] - sides[:, 1] * after[:, 0] <= 0).any():
            raise ValueError(
                "the corners [x, y] are needed clockwise, from the top left one on, none of them "
                "between the others"
            )
    return corners


@node(
    neutral="light",
    tolerance=Close(3e-4, why="places rounded to 1e-5 px, times a step between two pixels"),
)
def rectify(
    light: Light,
    pixel: PixelSize,
    *,
    width_mm: Millimetres,
    height_mm: Millimetres,
    corners: Annotated[Corners | None, AfterValidator(_clockwise)] = None,
) -> Light:
    """Return the images as a camera straight above a rectangle of known size sees them.

    OpenCV's `getPerspectiveTransform`.  The middle of the rectangle moves to the middle of the
    image, whose pixels then measure `pixel`.  Values between pixels are interpolated as in
    `undistort`, because OpenCV rounds places to 1/32 px.  What the camera does not see repeats
    the border (``BORDER_REPLICATE``).  `calibrate_camera` finds tilt and distortion more exactly.

    Parameters
    ----------
    light : K x H x W
    pixel : mm per px of the result
    width_mm, height_mm : sides of the rectangle
    corners
        Where the camera sees its corners: [x, y] in px, clockwise from the top left one.
        None: at the corners of the frame.
    """
    shape = light.shape[1:]
    across, down = _places(_homography(shape, pixel, width_mm, height_mm, corners), shape)
    return np.asarray([between_pixels(plane, across, down) for plane in light], np.float32)


def _homography(
    shape: tuple[int, ...], pixel: float, width_mm: float, height_mm: float, seen: Corners | None
) -> F4:
    """The homography's nine numbers, from places relative to the result's middle to the image."""
    rows, columns = shape
    left, top, right, bottom = -0.5, -0.5, columns - 0.5, rows - 0.5
    frame = ((left, top), (right, top), (right, bottom), (left, bottom))
    half = np.array([width_mm, height_mm]) / pixel / 2
    even = half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    homography = cv2.getPerspectiveTransform(
        np.asarray(even, np.float32), np.asarray(seen or frame, np.float32)
    )
    return np.asarray(homography, np.float32).ravel()


def _places(h: F4, shape: tuple[int, ...]) -> tuple[F4, F4]:
    """The columns and rows where the camera sees the pixels of the result."""
    rows, columns = shape
    u = np.arange(columns, dtype=np.float32) - np.float32((columns - 1) / 2)
    v = (np.arange(rows, dtype=np.float32) - np.float32((rows - 1) / 2))[:, None]
    depth = np.maximum(h[6] * u + h[7] * v + h[8], MIN_DEPTH)
    return (h[0] * u + h[1] * v + h[2]) / depth, (h[3] * u + h[4] * v + h[5]) / depth


@rectify.opencl()
def _launch(run: Launch) -> None:
    """Find the homography on the host, then look up every pixel."""
    shape = run.sizes["H"], run.sizes["W"]
    size = run.settings["width_mm"], run.settings["height_mm"]
    pixel, corners = float(run.inputs["pixel"]), run.settings["corners"]
    homography = run.put(_homography(shape, pixel, *size, corners))
    light, out = run.inputs["light"], run.outputs["rectify"]
    grid = run.in_row_lanes(*shape)
    run.kernel("look_up", grid, light, homography, out, run.sizes["K"], *shape, float(MIN_DEPTH))
