"""Read the untouched film, by which every image is divided."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge
from scipy.ndimage import gaussian_filter

from tactograph.graph import InputError, node, warn
from tactograph.nodes import F4, Dark, Light
from tactograph.nodes.read_capture import Crop, Layout, Leds, Lights, _grey, read_image, read_images


class Flat(NamedTuple):
    """The film at rest under each LED, and what the camera sees with none."""

    flat: Light
    dark: Dark


@node
def read_flat(
    image: Light,
    estimate: Light | None = None,
    *,
    folder: Path | None = None,
    dark: Path | None = None,
    lights: Lights | None = None,
    leds: Leds | None = None,
    files: str = "led{}",
    crop: Crop | None = None,
    smooth_px: Annotated[float, Ge(0)] = 2.0,
) -> Flat:
    """Read the capture of the untouched film, or stand in for it with uniform light.

    Parameters
    ----------
    image
        K x H x W, the capture that the flat has to fit.
    estimate
        K x H x W, what to use where there is no folder, as `estimate_flat` gives it.
    folder
        Capture of the untouched film.  None: the estimate; without one, the light is
        taken to be uniform, and a warning says so.
    dark
        One image taken with all LEDs off.  None: black.
    lights, leds, files, crop
        As for `read_capture`.
    smooth_px
        Standard deviation of the Gaussian that takes the noise out of the flat image.

    Raises
    ------
    InputError
        If the folder or image cannot be read, or is of another size than `image`.
    """
    height, width = image.shape[1:]
    black = np.zeros((height, width), np.float32) if dark is None else _read_dark(dark, crop)
    if black.shape != (height, width):
        raise InputError(
            f"{dark}: is {black.shape[1]} x {black.shape[0]} pixels, the capture {width} x {height}"
        )
    if folder is None and estimate is not None:
        return Flat(estimate, black)
    if folder is None:
        warn("no flat frame was given: uneven light and vignetting are not corrected (flat=DIR)")
        return Flat(np.ones_like(image), black)
    stack = read_images(folder, Layout(lights or "leds", leds, files, None, crop))
    if stack.shape != image.shape:
        raise InputError(
            f"{folder}: the untouched film is {_shape(stack)}, but the capture {_shape(image)}"
        )
    return Flat(np.stack([_smoothed(plane - black, smooth_px) for plane in stack]), black)


def _read_dark(file: Path, crop: Crop | None) -> F4:
    plane = _grey(read_image(file), file)
    if crop is not None:
        plane = plane[crop[1] : crop[3], crop[0] : crop[2]]
    return np.asarray(plane / np.float32(np.iinfo(plane.dtype).max), np.float32)


def _smoothed(plane: F4, sigma: float) -> F4:
    return np.asarray(gaussian_filter(plane, sigma, mode="nearest"), np.float32)


def _shape(stack: F4) -> str:
    return f"{stack.shape[0]} lights of {stack.shape[2]} x {stack.shape[1]} pixels"
